"""A whole simulated rig, its control handle and its faults by name.

`rig` connects plant, pucks and sensor; `LocalSimulation` is the control handle that
only a simulation has; `faults` injects faults by name. Begin with `rig`.
"""
