"""Programs beside sessions: benchmark, acceptance study, pendant script.

`bench` measures the loop on this machine, `acceptance` runs a whole simulated study,
`pendant` presses the buttons of a served simulated arm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
