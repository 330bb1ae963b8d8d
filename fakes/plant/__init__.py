"""The simulated arm with its foot and the hand that pushes it.

`plant` integrates the dynamics, `joints` is friction and stops, `gauges` what the
sensor feels, `hand` and `push` what a person does. Begin with `plant`.
"""
