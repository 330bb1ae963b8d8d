"""The ground as records of plain numbers, stepped by compiled functions.

`layout` is the record, `steps` the functions, `grounds` what the rest of the simulation
sees. Begin with `grounds`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
