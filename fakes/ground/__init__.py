"""Terrains: stones and plates that push back on the foot.

`terrain` is what a foot can stand and slip on, `stones` and `plate` the two kinds, each
one trial's ground. Begin with `terrain`.
"""
