"""The second screen: a session or a trial for viewers that speak Foxglove's protocol.

`channels` turns samples into messages, `server` is the door to foxglove-sdk, `watching`
follows a session that another process records.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
