"""Identification of gravity and friction of a real arm, and the calibration files.

Gravity: `poses` plans measurement poses and the path through them, `gravity_file`
stores the result for the control law. Friction: `excitation` plans the path, `sliding`
reduces the recording, `friction_fit` identifies, `friction_file` stores. Begin with
`poses`.
"""
