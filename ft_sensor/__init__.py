"""Wrist force/torque sensor: protocols, true force, tare.

`reading` is what every make tells, `payload` turns a raw wrench into the force at the
foot in the terrain's frame, `tare` is the reading without load. Makes live in
`vendors`. Begin with `payload`.
"""
