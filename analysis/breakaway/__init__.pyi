from .answers import AvailableForce, BreakAwayRisk
from .censored import Family
from .fitting import fit_break_away, fit_planned, fit_pushes
from .model import BREAK_AWAY, SLIDING, BreakAwayModel, PushLaw
from .pushes import V_SLIP, FootPush, find_pushes
from .recorded import (
    BreakAwayOptions,
    BreakAwayTask,
    TerrainPushes,
    plan_break_away,
)
from .survival import SurvivalCurve, kaplan_meier, pit_distance, pit_limit

__all__ = [
    "BREAK_AWAY",
    "SLIDING",
    "V_SLIP",
    "AvailableForce",
    "BreakAwayModel",
    "BreakAwayOptions",
    "BreakAwayRisk",
    "BreakAwayTask",
    "Family",
    "FootPush",
    "PushLaw",
    "SurvivalCurve",
    "TerrainPushes",
    "find_pushes",
    "fit_break_away",
    "fit_planned",
    "fit_pushes",
    "kaplan_meier",
    "pit_distance",
    "pit_limit",
    "plan_break_away",
]
