"""Simulated motor controllers and safety module, frame by frame.

`network` is what a host sees, `bank` the seven motor pucks, `safety_module` the eighth
voice, `wire` the time that frames take. Begin with `network`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
