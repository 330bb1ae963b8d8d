"""Contact models of terrains: stones and plates.

`terrain` is the ground of one trial: a plate, or a bed of `stones`. Begin with
`terrain`.
"""
