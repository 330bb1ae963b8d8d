"""Slip and terrain while they happen: one sample after the other, nothing ahead.

Begin with `engine`, what runs live and over a record; `training` fits it to trials,
`scores` says what it is worth on trials that it has not seen.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
