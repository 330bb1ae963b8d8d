"""Guided calibrations: move, let settle, collect, fit, show, write unless refused.

A `GuidedCalibration` defines these steps for one quantity, `calibrate` executes
them; a new one is added to `kinds`. The arithmetic is in `wam.calibration` and
`ft_sensor.calibration`. Begin with `calibration`.
"""
