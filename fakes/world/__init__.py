"""A whole simulated rig, its control handle and its faults by name.

`rig` joins plant, pucks and sensor; `LocalSimulation` is all that only a simulation can
be asked; `faults` does what a fault name says. Begin with `rig`.
"""
