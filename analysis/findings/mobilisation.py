"""How a ground takes up a load and lets it go, in the words of terramechanics.

Every loading is a rise of force from a floor to a peak, every event the fall after it
(`analysis.terrains.process_scores.falls`). What is said of them:

    initial stiffness   secant between 15 and 75 % of a rise, median [N/m]
    mobilisation way    peak over stiffness of its loading, median [m]
    run-out             way from a peak to 12 % of the next rise, mean [m]
    drop                mean [N], and shape of a Weibull distribution of drops
    way between drops   from peak to peak, mean [m]
    capacity over load  F_t over F_n at the peaks, median

The K of F_t = F_max (1 - exp(-j / K)) (Janosi and Hanamoto 1961) needs a loading that
bends: where the force at half of the way is at half of its rise, any large K will do.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.terrains.loadings import Interval90, loadings_of, spread_over_trials
from analysis.terrains.process_rows import ProcessTrial

_STRAIGHT = 0.6  # share of the rise at half of the way, up to which it is a line
_MOST_STRAIGHT = 0.2  # share of the loadings
_FEWEST = 3  # trials


class Mobilised(NamedTuple):
    """Loadings and events of one trial.

    Attributes:
        stiffness: of every loading [N/m].
        ways: of mobilisation, of every loading [m].
        run_outs: [m].
        drops: [N].
        between: way from one peak to the next [m].
        ratios: F_t over F_n at the peaks.
        halves: share of the rise at half of the way of every loading.
    """

    stiffness: Array
    ways: Array
    run_outs: Array
    drops: Array
    between: Array
    ratios: Array
    halves: Array


class Mobilisation(NamedTuple):
    """What the trials of a terrain say of its loadings and events.

    Attributes:
        trials: number of trials.
        values: by name, each with the interval that holds the value of as many other
            trials of the same ground nine times in ten.
        straight: share of the loadings that do not bend.
    """

    trials: int
    values: Mapping[str, Interval90]
    straight: float

    @property
    def has_exponential(self) -> bool:
        """Whether the K of an exponential is identifiable."""
        return self.straight <= _MOST_STRAIGHT


def mobilised(trial: ProcessTrial, least: float) -> Mobilised:
    """Return loadings and events of a trial.

    Args:
        trial: as a process.
        least: fall of force [N] that makes an event.
    """
    found = loadings_of(trial, least)
    is_known = np.isfinite(found.stiffness)
    stiffness = found.stiffness[is_known]
    return Mobilised(
        stiffness=stiffness,
        ways=found.peaks[1:][is_known] / stiffness,
        run_outs=found.run_outs,
        drops=found.peaks - found.floors,
        between=found.between,
        ratios=found.peaks / found.loads,
        halves=found.halves[is_known],
    )


def mobilisation_of(
    trials: Sequence[ProcessTrial], least: float, seed: int = 0
) -> Mobilisation | None:
    """Return what trials of a terrain say; None with fewer than three of them.

    Args:
        trials: of one terrain.
        least: fall of force [N] that makes an event.
        seed: of the draws of intervals.
    """
    each = [mobilised(trial, least) for trial in trials]
    each = [one for one in each if one.stiffness.size and one.between.size]
    if len(each) < _FEWEST:
        return None

    def logs(some: Sequence[Mobilised]) -> Array:
        return np.log(
            [
                statistic(np.concatenate([getattr(one, field) for one in some]))
                for field, statistic in _STATISTICS.values()
            ]
        )

    centre, reach = logs(each), spread_over_trials(each, logs, seed)
    ends = np.exp([centre, centre - reach, centre + reach])
    values = {
        n: Interval90(*row.tolist()) for n, row in zip(_STATISTICS, ends.T, strict=True)
    }
    halves = np.concatenate([one.halves for one in each])
    return Mobilisation(len(each), values, float(np.mean(halves <= _STRAIGHT)))


def weibull_shape(values: Array) -> float:
    """Return the likeliest shape of a Weibull distribution of positive values."""
    logs, k = np.log(np.maximum(values, 1e-9)), 1.5
    for _ in range(100):  # the likelihood's own equation, damped
        weight = values**k
        new = 1.0 / (float(weight @ logs / weight.sum()) - float(logs.mean()))
        if abs(new - k) < 1e-6:
            break
        k = 0.5 * (k + new)
    return float(k)


def _median(values: Array) -> float:
    return max(float(np.median(values)), 1e-9)


def _mean(values: Array) -> float:
    return max(float(values.mean()), 1e-9)


_STATISTICS: Mapping[str, tuple[str, Callable[[Array], float]]] = {
    "initial stiffness": ("stiffness", _median),
    "mobilisation way": ("ways", _median),
    "run-out": ("run_outs", _mean),
    "drop": ("drops", _mean),
    "Weibull shape of drops": ("drops", weibull_shape),
    "way between drops": ("between", _mean),
    "capacity over load": ("ratios", _median),
}
