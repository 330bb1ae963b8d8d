"""Gravity of a real arm: where it is measured and what is kept.

`poses` plans measurement poses and the way between them, `gravity_file` is the file
that a calibration writes and the control law reads.
"""
