"""Guided calibrations: gravity, sensor and foot, terrain.

`pose_walk` moves the arm from pose to pose and waits for it to stand, each other module
is one calibration.
"""
