"""Trials to look at first: those that stand out among the trials of their terrain.

Of every trial some measures are taken, and each is compared with the median of the
other trials of its terrain. The scale is the median absolute deviation (Huber 1981,
Robust Statistics, section 5.1), of the terrain's own trials and of those of all
terrains together, as ten trials alone tell their spread badly:

    z = (x - median) / sqrt((n s^2 + n0 s0^2) / (n + n0))

A trial is named beyond `LIMIT`, or where its motion and forces cannot be right. What a
foot shows that stands, before anybody pushes, tells most of the sensor: stones and
hands differ from trial to trial, its weight and the noise do not. Forces that are some
milliseconds late do not show on plates.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.plausibility import doubts_of, standing_rows
from analysis.data.prepare import Smoothed
from analysis.data.series import Array
from analysis.study.models import TUSTIN
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_HAND = 0.15  # a hand differs by so much, or its double, from push to push [log]
LIMIT = 6.0  # scales from the median of the terrain's trials
_FEWEST = 4  # trials of a terrain that are compared
_PRIOR = 5.0  # trials that the scale of all terrains counts as
_TO_SD = 1.4826  # of a median absolute deviation of normal values
_SMOOTH = "friction"  # a doubt that smooth ground raises; the ratio is compared
_TOLD = 3  # measures in one reason
_STANDING = 0.5  # s at the start in which the foot stands and nobody pushes yet
_FEWEST_ROWS = 50  # of them


@dataclass(frozen=True, slots=True)
class Measure:
    """What trials are compared by.

    Attributes:
        words: what stands out, in words.
        least: scale below which no difference counts.
        is_log: values are logarithms of a ratio.
        unit: of values that are none.
    """

    words: str
    least: float
    is_log: bool = False
    unit: str = ""

    def text(self, difference: float) -> str:
        """Return how far a trial is from the others."""
        if self.is_log:
            return f"{self.words} {math.exp(difference):.2g} times the others'"
        return f"{self.words} {difference:+.2g} {self.unit} from the others"


MEASURES: Mapping[str, Measure] = {
    "residual": Measure("F_t of the same load and velocity", 0.1, unit="N"),
    "load": Measure("normal force", _HAND, is_log=True),
    "ratio": Measure("F_t/F_n", 0.03, is_log=True),
    "speed": Measure("velocity", _HAND, is_log=True),
    "kept": Measure("kept samples", _HAND, is_log=True),
    "way": Measure("way", 0.05, is_log=True),
    "noise": Measure("change from sample to sample", _HAND, is_log=True),
    "lag": Measure("delay of the force", 1.0, unit="ms"),
    "rest_t": Measure("F_t of the foot that stands", 0.2, unit="N"),
    "rest_n": Measure("F_n of the foot that stands", 0.2, unit="N"),
    "rest_noise_t": Measure("noise of F_t at rest", 0.05, is_log=True),
    "rest_noise_n": Measure("noise of F_n at rest", 0.05, is_log=True),
}


@dataclass(frozen=True, slots=True)
class OddTrial:
    """A trial that stands out.

    Attributes:
        terrain: its terrain.
        number: of the trial on its terrain, from 1.
        name: of the trial.
        score: how far it stands out [scales]; infinite where it cannot be right.
        reasons: what stands out, the farthest first.
    """

    terrain: str
    number: int
    name: str
    score: float
    reasons: tuple[str, ...]


def look_first(study: Study, limit: float = LIMIT) -> list[OddTrial]:
    """Return the trials that stand out, the farthest first; none in a sound study.

    Args:
        study: the study.
        limit: beyond which a trial stands out [scales].
    """
    measured = {
        name: [_measured(result, k) for k in range(len(result.trials))]
        for name, result in study.terrains.items()
    }
    scales = _scales(measured.values())
    odd: list[OddTrial] = []
    for name, result in study.terrains.items():
        compared = _compared(measured[name], scales)
        for k, trial in enumerate(result.trials):
            doubts = [d.seen for d in doubts_of(trial) if d.name != _SMOOTH]
            ranked = sorted(compared[k], key=lambda found: -abs(found[0]))
            told = [text for z, text in ranked if abs(z) > limit][:_TOLD]
            if doubts or told:
                score = math.inf if doubts else abs(ranked[0][0])
                odd.append(OddTrial(name, k + 1, trial.name, score, (*doubts, *told)))
    return sorted(odd, key=lambda trial: -trial.score)


def _measured(result: TerrainResult, number: int) -> dict[str, float]:
    """Return the measures of a trial; those that it does not show are missing."""
    trial = result.trials[number]
    if not trial.kept:
        return {}
    values = {
        "speed": float(np.log(trial.v_t.mean())),
        "kept": math.log(trial.kept),
        "noise": _noise(trial.smooth.F_t),
    }
    if trial.travel > 0.0:
        values["way"] = math.log(trial.travel)
    load, force = float(trial.F_n.mean()), float(trial.F_t.mean())
    if load > 0.0:
        values["load"] = math.log(load)
        if force > 0.0:
            values["ratio"] = math.log(force / load)
    if trial.lag is not None:
        values["lag"] = 1e3 * trial.lag.seconds
    values |= _standing(trial.smooth)
    for fold in result.folds:
        if number in fold.left_out and TUSTIN in fold.models:
            model = fold.models[TUSTIN].model
            rest = trial.F_t - model.mean(trial.F_n, trial.v_t, trial.further)
            values["residual"] = float(rest.mean())
    return values


def _standing(smooth: Smoothed) -> dict[str, float]:
    """Return what the sensor shows of a foot that stands and nobody pushes yet."""
    until = smooth.t[0] + _STANDING
    end = min(standing_rows(smooth), int(np.searchsorted(smooth.t, until)))
    if end < _FEWEST_ROWS:
        return {}
    F_t, F_n = smooth.F_t[:end], smooth.F_n[:end]
    return {
        "rest_t": float(np.median(F_t)),
        "rest_n": float(np.median(F_n)),
        "rest_noise_t": _noise(F_t),
        "rest_noise_n": _noise(F_n),
    }


def _noise(force: Array) -> float:
    """Return the logarithm of the change from sample to sample."""
    return float(np.log(np.abs(np.diff(force)).mean() + 1e-9))


def _deviations(values: Sequence[Mapping[str, float]], name: str) -> Array:
    """Return how far trials are from the median of the others; nan where unknown."""
    x = np.array([each.get(name, math.nan) for each in values])
    if np.count_nonzero(np.isfinite(x)) < _FEWEST:
        return np.full(x.shape, math.nan)
    away = np.full(x.shape, math.nan)
    for k in np.flatnonzero(np.isfinite(x)):
        away[k] = x[k] - np.nanmedian(np.delete(x, k))
    return away


def _spread(away: Array) -> float:
    known = np.abs(away[np.isfinite(away)])
    return _TO_SD * float(np.median(known)) if known.size else 0.0


def _scales(
    terrains: Collection[Sequence[Mapping[str, float]]],
) -> dict[str, float]:
    """Return the scale of every measure over all terrains."""
    return {
        name: _spread(
            np.concatenate([_deviations(values, name) for values in terrains])
        )
        for name in MEASURES
    }


def _compared(
    values: Sequence[Mapping[str, float]], scales: Mapping[str, float]
) -> list[list[tuple[float, str]]]:
    """Return for every trial its z and words of every measure that it shows."""
    found: list[list[tuple[float, str]]] = [[] for _ in values]
    for name, measure in MEASURES.items():
        away = _deviations(values, name)
        count = float(np.count_nonzero(np.isfinite(away)))
        own, common = _spread(away), scales[name]
        pooled = (count * own**2 + _PRIOR * common**2) / (count + _PRIOR)
        scale = max(math.sqrt(pooled), measure.least)
        for k, difference in enumerate(away.tolist()):
            if math.isfinite(difference):
                found[k].append((difference / scale, measure.text(difference)))
    return found
