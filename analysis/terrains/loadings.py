"""Rises of force from a floor to a peak, and the falls after them, trial by trial.

They are those of `analysis.terrains.process_scores.falls`; the way is forward motion.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from analysis.data.series import Array
from analysis.terrains.process_rows import STEP, ProcessTrial
from analysis.terrains.process_scores import falls

LEAST_LOAD = 0.8  # N

_SECANT = (0.15, 0.75)  # of a rise
_BEGUN = 0.12  # of a rise at which a run-out ends
_LEAST_WAY = 0.3e-3  # m of a loading
_DRAWS, _SHARE = 200, 0.95  # trials drawn again; one end of a 90 % interval
_T = TypeVar("_T")


class Loadings(NamedTuple):
    """Loadings and falls of one trial.

    Attributes:
        rows: of every loading its floor, where it begins and its peak, shape (n, 3).
        stiffness: secant of every loading [N/m]; NaN where its way is too short.
        halves: share of the rise at half of the way of every loading; NaN as well.
        run_outs: way from the peak before to where every loading begins [m].
        peaks: force at the peak of every fall [N], shape (n + 1,) at most.
        floors: force at its floor [N].
        loads: F_n at the peak, 0.8 N at least [N].
        between: way from one peak to the next [m].
    """

    rows: np.ndarray
    stiffness: Array
    halves: Array
    run_outs: Array
    peaks: Array
    floors: Array
    loads: Array
    between: Array


class Interval90(NamedTuple):
    """A value with the ends of its 90 % interval."""

    value: float
    lower: float
    upper: float


def loadings_of(trial: ProcessTrial, least: float) -> Loadings:
    """Return loadings and falls of a trial.

    Args:
        trial: as a process.
        least: fall of force [N] that makes an event.
    """
    F, x = trial.F_t, STEP * np.cumsum(np.maximum(trial.v_t, 0.0))
    peaks, floors = falls(F, least)
    stiffness: list[float] = []
    halves: list[float] = []
    begins: list[int] = []
    run_outs: list[float] = []
    for floor, peak, before in zip(floors[:-1], peaks[1:], peaks[:-1], strict=True):
        rise, way = F[floor : peak + 1], x[floor : peak + 1]
        height = F[peak] - F[floor]
        low, high, begun = (
            int(np.argmax(rise >= F[floor] + share * height))
            for share in (*_SECANT, _BEGUN)
        )
        begins.append(int(floor) + begun)
        run_outs.append(float(way[begun] - x[before]))
        length, gain = float(way[high] - way[low]), float(rise[high] - rise[low])
        if length < _LEAST_WAY:
            stiffness.append(np.nan)
            halves.append(np.nan)
            continue
        stiffness.append(gain / length)
        middle = 0.5 * (way[low] + way[high])
        at_half = float(np.interp(middle, way[low : high + 1], rise[low : high + 1]))
        halves.append((at_half - float(rise[low])) / max(gain, 1e-9))
    return Loadings(
        rows=np.column_stack([floors[:-1], np.array(begins, dtype=int), peaks[1:]]),
        stiffness=np.array(stiffness),
        halves=np.array(halves),
        run_outs=np.array(run_outs),
        peaks=F[peaks],
        floors=F[floors],
        loads=np.maximum(trial.F_n[peaks], LEAST_LOAD),
        between=np.diff(x[peaks]),
    )


def spread_over_trials(
    trials: Sequence[_T], statistic: Callable[[Sequence[_T]], Array], seed: int
) -> Array:
    """Return how far values are from those of as many other trials, nine in ten.

    The spread of a value over trials drawn again with replacement is the one of its
    estimate. Other trials have that spread, too: the reach is the root of two wider.

    Args:
        trials: what is known of each.
        statistic: values of some of them, shape (n,).
        seed: of the draws.

    Returns:
        Half of the width of the 90 % interval of every value, shape (n,).
    """
    from scipy.special import stdtrit

    rng = np.random.default_rng(seed)
    drawn = rng.integers(len(trials), size=(_DRAWS, len(trials)))
    again = np.array([statistic([trials[k] for k in chosen]) for chosen in drawn])
    width = np.sqrt(2.0) * float(stdtrit(len(trials) - 1, _SHARE))
    return width * again.std(axis=0)
