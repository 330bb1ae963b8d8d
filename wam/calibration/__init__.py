"""Gravity of a real arm: where it is measured and what is kept.

`poses` plans measurement poses and the way between them, `gravity_file` is the file
that a calibration writes and the control law reads.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
