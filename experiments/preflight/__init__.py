"""Is the rig fit to run, and is it still the rig the session began on.

`preflight` runs the graded checks, `host_checks` has those of the computer, `page`
takes their lines; `conditions` compares settings with those of the unfinished session.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
