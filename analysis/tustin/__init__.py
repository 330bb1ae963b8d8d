"""Tustin's friction model: fit, intervals, identifiability.

`model` is equation (1) of the paper and its fit, `varpro` the search over its two
nonlinear parameters. Begin with `model`.
"""
