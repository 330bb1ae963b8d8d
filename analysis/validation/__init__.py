"""What a simulated study has to show: bands and the measures they hold.

`bands` lists every band with its source, the other modules compute the measures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
