from . import model
from .bootstrap import bootstrap_tustin
from .identifiability import Interval, Profiles
from .model import (
    MINIMUM_ROWS,
    NEGATIVE_B,
    NO_STRIBECK,
    NOT_IDENTIFIABLE,
    UNITS,
    TustinBounds,
    TustinFit,
    TustinForm,
    TustinParameters,
    fit_tustin,
)

__all__ = [
    "MINIMUM_ROWS",
    "NEGATIVE_B",
    "NOT_IDENTIFIABLE",
    "NO_STRIBECK",
    "UNITS",
    "Interval",
    "Profiles",
    "TustinBounds",
    "TustinFit",
    "TustinForm",
    "TustinParameters",
    "bootstrap_tustin",
    "fit_tustin",
    "model",
]
