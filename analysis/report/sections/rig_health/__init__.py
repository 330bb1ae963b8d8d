"""Rig health: control loop, sensor and arm in every trial.

`health` computes the numbers. Begin with `section`.
"""
