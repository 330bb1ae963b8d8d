"""The simulated bus: in this process, on a socket, on any python-can adapter.

`in_process` is a `can.BusABC` on stepped time and a door to it, `hub` and `client` the
two ends of a socket, `adapter` any other bus.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
