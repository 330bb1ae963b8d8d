"""The force that a foot at rest may ask for before the ground gives.

`pushes` cuts trials into pushes that slipped or held, `fitting` fits the model of their
peak forces, `model` answers: the risk of a slip, the force available at a risk.
"""
