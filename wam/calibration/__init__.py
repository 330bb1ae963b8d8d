"""Gravity and friction of a real arm: where they are measured and what is kept.

`poses` plans measurement poses and the way between them, `gravity_file` is the file
that a calibration writes and the control law reads. For friction `excitation` plans the
way, `sliding` reduces what was recorded, `friction_fit` identifies, `friction_file`
keeps. Begin with `poses`.
"""
