"""Sensor, foot and container measured: least-squares fits and their files.

`fit` finds mass, centre, bias and mounting from wrenches in known poses, `files` and
`sensor_file` read and write what was found.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
