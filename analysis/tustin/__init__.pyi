from . import model
from .bootstrap import bootstrap_tustin
from .identifiability import Interval, Profiles, correlation_samples
from .model import (
    MINIMUM_ROWS,
    NEGATIVE_B,
    NO_STRIBECK,
    NOT_IDENTIFIABLE,
    SYMBOLS,
    UNITS,
    TustinBounds,
    TustinFit,
    TustinForm,
    TustinParameters,
    bound,
    fit_tustin,
)

__all__ = [
    "MINIMUM_ROWS",
    "NEGATIVE_B",
    "NOT_IDENTIFIABLE",
    "NO_STRIBECK",
    "SYMBOLS",
    "UNITS",
    "Interval",
    "Profiles",
    "TustinBounds",
    "TustinFit",
    "TustinForm",
    "TustinParameters",
    "bootstrap_tustin",
    "bound",
    "correlation_samples",
    "fit_tustin",
    "model",
]
