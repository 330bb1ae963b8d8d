"""Guided calibrations: gravity, friction, sensor and foot, terrain.

Each module is one; `experiments.run.PoseWalk` moves the arm from pose to pose.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
