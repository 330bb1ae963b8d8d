"""Terrains of a database for other programs: controllers, simulators, maps.

Begin with `source`: what is exported. `profile` makes one number per episode out of a
terrain, `targets` has a module for every program that reads it, `folder` puts what a
target writes together with its README and where it comes from.
"""
