"""rig.toml, matrix.toml and calibration files: read, checked, explained.

`load` returns `Settings` or names every error, `rig` and `matrix` say what may stand in
the files, `origins` where a value came from. Begin with `load`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
