"""Rig health: how loop, sensor and arm were in every trial.

`health` has the numbers. Begin with `section`.
"""
