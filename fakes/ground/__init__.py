"""Terrains: stones and plates that push back on the foot.

`terrain` is what a foot can stand and slip on: a plate, or a bed of `stones`; each is
one trial's ground. Begin with `terrain`.
"""
