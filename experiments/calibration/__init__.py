"""Guided calibrations: gravity, friction, sensor and foot, terrain, place.

Each is a module of its own; `guiding` opens the rig and leaves the arm idle. The
arithmetic is in `wam.calibration` and `ft_sensor.calibration`.
"""
