"""One make of sensor a module: its protocol, its start-up, its settings.

Bota, Robotous and OptoForce on a serial line, Barrett on the arm's bus. A new make is a
new module here and an entry in the registry.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
