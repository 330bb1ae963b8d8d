"""Guided calibrations: gravity, sensor and foot, terrain.

`pose_walk` moves the arm from pose to pose and waits for it to stand, each other module
is one calibration.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
