"""Which terrain is it, and what traction does it give.

`identify` tells terrains apart by the models of a study, `database` is the table that a
locomotion controller queries.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
