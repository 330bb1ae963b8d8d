"""Terrains: stones and plates that push back on the foot.

`terrain` is what a foot can stand and slip on: a plate, or a bed of `stones`; each is
one trial's ground. Begin with `terrain`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
