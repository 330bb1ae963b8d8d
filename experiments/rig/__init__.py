"""Composition root: builds a real or simulated rig from settings.

`rig` joins devices, loop and recorder; a backend runs them in this thread (stepped
time) or in separate processes; only `fake` imports the simulated devices. Begin with
`rig`.
"""
