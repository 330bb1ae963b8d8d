"""Simulated wrist sensors: firmware, bytes, errors, ports.

`stream` is a sensor seen from its end of the wire, each make a firmware, `errors` what
it adds to the truth, `port` and `pty` the line. Begin with `stream`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
