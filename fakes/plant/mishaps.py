"""What a clumsy hand does on the way: it swerves into the frame, it lifts the foot."""

import math
from dataclasses import dataclass

_SWERVE, _SWERVE_OVER = 0.075, 0.06  # how far aside, over which way [m]
_LIFT, _LIFT_OVER = 0.025, 0.04  # how high, over which way [m]


@dataclass(frozen=True, slots=True)
class Mishaps:
    """Where along the container they happen.

    Attributes:
        swerve_at: where the hand begins to swerve [m]; infinite = never.
        lift_at: where it begins to lift the foot [m]; infinite = never.
    """

    swerve_at: float = math.inf
    lift_at: float = math.inf

    def at(self, x: float) -> tuple[float, float]:
        """Return (how far aside, how high) the hand wants the foot at `x` [m]."""
        aside = _SWERVE * _bump((x - self.swerve_at) / _SWERVE_OVER)
        return aside, _LIFT * _bump((x - self.lift_at) / _LIFT_OVER)


NO_MISHAPS = Mishaps()


def _bump(share: float) -> float:
    """Return a smooth hill of height 1 over 0 to 1."""
    if not 0.0 < share < 1.0:
        return 0.0
    return math.sin(math.pi * share) ** 2
