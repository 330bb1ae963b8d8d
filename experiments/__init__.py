"""What the operator and the scientist do: the program `traction`.

`commands` has one file a command, `run` the flow of a session, `session` its state on
the disk, `rig` the composition root. Begin with `commands.run`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
