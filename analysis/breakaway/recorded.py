"""What break-away models are fitted to: pushes, and forces in slow motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from analysis.breakaway.pushes import V_SLIP, FootPush, find_pushes
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array

_SLOW, _FAST = 0.005, 0.02  # m/s of sliding


@dataclass(frozen=True, slots=True)
class BreakAwayOptions:
    """How break-away models are fitted.

    Attributes:
        v_slip: velocity that makes a slip [m/s].
        draws: number of times that the trials are resampled for intervals.
        seed: of the resampling.
    """

    v_slip: float = V_SLIP
    draws: int = 200
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class TerrainPushes:
    """The pushes of a terrain's trials, and what its foot met in slow motion.

    Attributes:
        name: of the terrain.
        pushes: of every trial.
        slow: F_n and F_t [N] of every trial at 0.005 to 0.02 m/s; empty = not known.
    """

    name: str
    pushes: tuple[tuple[FootPush, ...], ...]
    slow: tuple[tuple[Array, Array], ...] = ()

    @property
    def every(self) -> list[FootPush]:
        """All pushes, trial by trial."""
        return list(chain(*self.pushes))

    @property
    def slips(self) -> int:
        """Number of pushes that slipped."""
        return sum(not push.is_held for push in self.every)


@dataclass(frozen=True, slots=True)
class BreakAwayTask:
    """Everything that the fit of all terrains needs.

    Attributes:
        terrains: their pushes.
        kinds: kind by terrain: "small" and "big" are stones.
        options: what a slip is, and how many times trials are resampled.
    """

    terrains: tuple[TerrainPushes, ...]
    kinds: Mapping[str, str]
    options: BreakAwayOptions


def plan_break_away(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str],
    options: BreakAwayOptions,
) -> BreakAwayTask:
    """Return the task of fitting prepared trials by terrain; empty ones do not count.

    Args:
        trials: prepared trials by terrain.
        kinds: kind by terrain: "small" and "big" are stones.
        options: what a slip is, and how many times trials are resampled.
    """
    terrains: list[TerrainPushes] = []
    for name, group in trials.items():
        usable = [trial for trial in group if trial.kept]
        pushes = tuple(find_pushes(trial, options.v_slip) for trial in usable)
        slow = tuple(_slow_rows(trial) for trial in usable)
        terrains.append(TerrainPushes(name, pushes, slow))
    return BreakAwayTask(tuple(terrains), dict(kinds), options)


def _slow_rows(trial: PreparedTrial) -> tuple[Array, Array]:
    """Return F_n and F_t [N] of the kept samples in slow motion."""
    is_slow = (trial.v_t >= _SLOW) & (trial.v_t <= _FAST)
    return trial.F_n[is_slow], trial.F_t[is_slow]
