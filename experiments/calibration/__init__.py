"""Guided calibrations: move, let settle, collect, fit, show, keep.

A `GuidedCalibration` is what a module says of these, `calibrate` the way through all of
them; the arithmetic is in `wam.calibration` and `ft_sensor.calibration`. Begin with
`calibration`.
"""
