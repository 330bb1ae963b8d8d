"""Recorded sessions to reports and exports.

`sessions` chooses and analyses, `truth_errors` holds simulated sessions against their
truth, `export` writes tables. Begin with `sessions`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
