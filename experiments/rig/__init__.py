"""The composition root: settings in, a rig out, real or simulated.

`rig` joins devices, loop and recorder; a backend runs them in this thread (stepped
time) or in processes of their own; `fake` alone knows the simulated devices. Begin with
`rig`.
"""
