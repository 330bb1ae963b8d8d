"""A session on the disk: states, journal, files, recovery.

`states` is the table of (phase x event), `reducer` applies the `journal` to it,
`trial_files` follow the journal, `crash_recovery` finishes what a kill cut short. Begin
with `states`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
