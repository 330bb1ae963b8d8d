from .answers import AvailableForce, BreakAwayRisk
from .censored import Family
from .fitting import BreakAwayOptions, fit_break_away, fit_pushes
from .model import BREAK_AWAY, SLIDING, BreakAwayModel, PushLaw
from .pushes import V_SLIP, FootPush, find_pushes
from .survival import SurvivalCurve, kaplan_meier, pit_distance, pit_limit

__all__ = [
    "BREAK_AWAY",
    "SLIDING",
    "V_SLIP",
    "AvailableForce",
    "BreakAwayModel",
    "BreakAwayOptions",
    "BreakAwayRisk",
    "Family",
    "FootPush",
    "PushLaw",
    "SurvivalCurve",
    "find_pushes",
    "fit_break_away",
    "fit_pushes",
    "kaplan_meier",
    "pit_distance",
    "pit_limit",
]
