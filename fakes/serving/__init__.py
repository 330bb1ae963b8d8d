"""The simulated rig as a process, its bus and sensor for other programs.

`rig_process` serves a session, `puck_server` and `sensor_server` any other program.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
