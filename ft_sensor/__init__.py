"""Wrist force/torque sensor: protocols, contact force, tare.

`reading` is the common format of all makes, `payload` converts a raw wrench to the
contact force in the terrain frame, `tare` is the reading without load. Makes are in
`vendors`. Begin with `payload`.
"""
