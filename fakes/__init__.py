"""Simulated devices at the wire, shipped because `--fake` is a feature.

`plant` moves the arm, `ground` pushes back, `pucks` answer on `bus`, `sensor` emits
bytes; `world` joins them, `serving` gives them to other processes. Begin with
`world.rig`.
"""
