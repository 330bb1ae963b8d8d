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
from analysis.terrains.process_rows import STEP, ProcessTrial
from analysis.terrains.process_scores import falls

_SECANT = (0.15, 0.75)  # of a rise
_BEGUN = 0.12  # of a rise at which a run-out ends
_LEAST_WAY = 0.3e-3  # m of a loading
_LEAST_LOAD = 0.8  # N
_STRAIGHT = 0.6  # share of the rise at half of the way, up to which it is a line
_MOST_STRAIGHT = 0.2  # share of the loadings
_DRAWS, _SHARE = 200, 0.95  # trials drawn again; one end of a 90 % interval
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


class Interval90(NamedTuple):
    """A value with the ends of its 90 % interval."""

    value: float
    lower: float
    upper: float


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
    F, x = trial.F_t, STEP * np.cumsum(np.maximum(trial.v_t, 0.0))
    peaks, floors = falls(F, least)
    found: list[tuple[float, float, float]] = []
    run_outs: list[float] = []
    for floor, peak, before in zip(floors[:-1], peaks[1:], peaks[:-1], strict=True):
        rise, way = F[floor : peak + 1], x[floor : peak + 1]
        height = F[peak] - F[floor]
        low, high, begun = (
            int(np.argmax(rise >= F[floor] + share * height))
            for share in (*_SECANT, _BEGUN)
        )
        run_outs.append(float(way[begun] - x[before]))
        length = float(way[high] - way[low])
        if length < _LEAST_WAY:
            continue
        stiffness = float(rise[high] - rise[low]) / length
        middle = 0.5 * (way[low] + way[high])
        at_half = float(np.interp(middle, way[low : high + 1], rise[low : high + 1]))
        half = (at_half - rise[low]) / max(rise[high] - rise[low], 1e-9)
        found.append((stiffness, float(F[peak]) / stiffness, half))
    stiffness, ways, halves = np.array(found).reshape(-1, 3).T
    ratios = F[peaks] / np.maximum(trial.F_n[peaks], _LEAST_LOAD)
    drops, between = F[peaks] - F[floors], np.diff(x[peaks])
    return Mobilised(
        stiffness, ways, np.array(run_outs), drops, between, ratios, halves
    )


def mobilisation_of(
    trials: Sequence[ProcessTrial], least: float, seed: int = 0
) -> Mobilisation | None:
    """Return what trials of a terrain say; None with fewer than three of them.

    The spread of a value over trials drawn again with replacement is the one of its
    estimate. Other trials have that spread, too: the interval is the root of two wider.

    Args:
        trials: of one terrain.
        least: fall of force [N] that makes an event.
        seed: of the draws.
    """
    from scipy.special import stdtrit

    each = [mobilised(trial, least) for trial in trials]
    each = [one for one in each if one.stiffness.size and one.between.size]
    if len(each) < _FEWEST:
        return None
    rng = np.random.default_rng(seed)
    drawn = rng.integers(len(each), size=(_DRAWS, len(each)))
    width = np.sqrt(2.0) * float(stdtrit(len(each) - 1, _SHARE))
    values: dict[str, Interval90] = {}
    for name, (field, statistic) in _STATISTICS.items():
        parts = [getattr(one, field) for one in each]
        value = statistic(np.concatenate(parts))
        again = [
            statistic(np.concatenate([parts[k] for k in chosen])) for chosen in drawn
        ]
        spread = width * float(np.std(np.log(again)))
        ends = value * np.exp([-spread, spread])
        values[name] = Interval90(value, *ends.tolist())
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
