"""Dynamics of the simulated arm with its foot and the operator's hand.

`plant` and `body` integrate the dynamics, `joints` models drives and stops, `friction`
the bristles, `gauges` the load on the sensor, `hand` and `push` the person. Begin with
`plant`.
"""
