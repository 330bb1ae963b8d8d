"""Simulated devices, from the physics to the bytes on the wire, for `--fake`.

`plant` is the arm's dynamics, `ground` the contact model, `pucks` answer on `bus`,
`sensor` emits bytes; `world` combines them, `serving` offers them to other processes.
Begin with `world.rig`.
"""
