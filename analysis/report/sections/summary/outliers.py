"""Outlier trials: trials that differ from the others of their terrain.

Several measures of every trial are compared with those of the other trials of its
terrain. Ten trials estimate their spread poorly, so the spread on the other terrains
serves as prior (as in moderated t statistics, Smyth 2004, Statistical Applications in
Genetics and Molecular Biology 3):

    t = (x - median) / (s sqrt(1 + pi / (2 n))),  s^2 = (n s_1^2 + n0 s_0^2) / (n + n0)

s_1 is the scale Q_n of the others (Rousseeuw and Croux 1993, J. Am. Stat. Assoc. 88),
which is robust to several outliers; s_0 is the geometric mean over other terrains, or
s_1 for a single terrain. t is converted to the normal score of equal probability. A
trial is listed if it exceeds the limit of a measure, or if its motion and forces are
implausible.
The readings of the foot at rest, before it is pushed, reveal most about the sensor: its
weight and the noise hardly differ between trials. Stones and hands do differ, with
heavier tails than a normal distribution. Forces late by some milliseconds do not show
on plates.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isinf

import numpy as np

from analysis.data.plausibility import doubts_of, standing_rows
from analysis.data.prepare import Smoothed
from analysis.data.series import Array
from analysis.report.section import ReportSection, ReportTable
from analysis.study.models import TUSTIN
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_HAND = 0.15  # variation from push to push of a hand, up to a factor of two [log]
SENSOR_LIMIT = 4.0  # limit of the normal score for measures of the sensor alone
PUSH_LIMIT = 5.0  # limit for measures that also depend on stones and hand
_FEWEST = 4  # smallest number of trials of a terrain for a comparison
_PRIOR = 5.0  # weight of the scale of the other terrains [trials]
_MANY = 30  # trials beyond which the scale of all trials is used
# Q_n: consistency factor for normal values, small-sample factors for 2 to 9 values, and
# efficiency.
_QN_TO_SD = 2.2219
_QN_FEW = (0.399, 0.994, 0.512, 0.844, 0.611, 0.857, 0.669, 0.872)
_QN_EFFICIENCY = 0.8
_SMOOTH = "friction"  # doubt that smooth ground raises; covered by the measure "ratio"
_MOST_REASONS = 3  # measures listed per trial
_STANDING = 0.5  # s at the start in which the foot stands and is not pushed
_FEWEST_ROWS = 50  # smallest number of rows at rest
_MOST_OUTLIERS = 10  # trials listed


@dataclass(frozen=True, slots=True)
class Measure:
    """Measure by which trials are compared.

    Attributes:
        words: name of the measure in words.
        least: lower limit of the scale.
        is_log: values are logarithms of a ratio.
        unit: unit of other values.
        limit: normal score beyond which a trial is listed.
    """

    words: str
    least: float
    is_log: bool = False
    unit: str = ""
    limit: float = PUSH_LIMIT

    def is_known(self, scale: float) -> bool:
        """Return whether the scale is below the known variation of hands."""
        return self.least == _HAND and scale < _HAND

    def text(self, difference: float) -> str:
        """State the difference of a trial from the others."""
        if self.is_log:
            return f"{self.words} {math.exp(difference):.2g} times the others'"
        return f"{self.words} {difference:+.2g} {self.unit} from the others"


MEASURES: Mapping[str, Measure] = {
    "residual": Measure("F_t at the same load and velocity", 0.1, unit="N"),
    "load": Measure("normal force", _HAND, is_log=True),
    "ratio": Measure("F_t/F_n", 0.03, is_log=True),
    "speed": Measure("velocity", _HAND, is_log=True),
    "kept": Measure("kept samples", _HAND, is_log=True),
    "travel": Measure("travel", 0.05, is_log=True),
    "noise": Measure(
        "change from sample to sample", _HAND, is_log=True, limit=SENSOR_LIMIT
    ),
    "lag": Measure("delay of the force", 1.0, unit="ms", limit=SENSOR_LIMIT),
    "rest_t": Measure("F_t at rest", 0.2, unit="N", limit=SENSOR_LIMIT),
    "rest_n": Measure("F_n at rest", 0.2, unit="N", limit=SENSOR_LIMIT),
    "rest_noise_t": Measure(
        "noise of F_t at rest", 0.05, is_log=True, limit=SENSOR_LIMIT
    ),
    "rest_noise_n": Measure(
        "noise of F_n at rest", 0.05, is_log=True, limit=SENSOR_LIMIT
    ),
}


@dataclass(frozen=True, slots=True)
class OutlierTrial:
    """An outlier trial.

    Attributes:
        terrain: name of the terrain.
        number: number of the trial on its terrain, from 1.
        name: name of the trial.
        score: largest score, 1 = at the limit of a measure; infinite if implausible.
        reasons: outlying measures, the largest first.
    """

    terrain: str
    number: int
    name: str
    score: float
    reasons: tuple[str, ...]


def outlier_trials(study: Study) -> list[OutlierTrial]:
    """Return the outlier trials, the largest score first; none in a sound study."""
    measured = {
        name: [_measures(result, k) for k in range(len(result.trials))]
        for name, result in study.terrains.items()
    }
    scored = _scores(measured)
    outliers: list[OutlierTrial] = []
    for name, result in study.terrains.items():
        for k, trial in enumerate(result.trials):
            doubts = [d.seen for d in doubts_of(trial) if d.name != _SMOOTH]
            ranked = sorted(scored[name][k], key=lambda entry: -abs(entry[0]))
            texts = [text for share, text in ranked if abs(share) > 1.0]
            reasons = (*doubts, *texts[:_MOST_REASONS])
            if reasons:
                score = math.inf if doubts else abs(ranked[0][0])
                outliers.append(OutlierTrial(name, k + 1, trial.name, score, reasons))
    return sorted(outliers, key=lambda trial: -trial.score)


def _measures(result: TerrainResult, number: int) -> dict[str, float]:
    """Compute the measures of a trial; unavailable ones are missing."""
    trial = result.trials[number]
    if not trial.kept:
        return {}
    values = {
        "speed": float(np.log(trial.v_t.mean())),
        "kept": math.log(trial.kept),
        "noise": _noise(trial.smooth.F_t),
    }
    if trial.travel > 0.0:
        values["travel"] = math.log(trial.travel)
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
            residual = trial.F_t - model.mean(trial.F_n, trial.v_t, trial.further)
            values["residual"] = float(residual.mean())
    return values


def _standing(smooth: Smoothed) -> dict[str, float]:
    """Compute the measures of the foot at rest before it is pushed."""
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
    """Return the logarithm of the mean change from sample to sample."""
    return float(np.log(np.abs(np.diff(force)).mean() + 1e-9))


def qn_scale(x: Array) -> float:
    """Return the robust scale Q_n of values; consistent for normal values.

    A quantile of the pairwise distances, with a breakdown point of one half.

    Args:
        x: at least two values, shape (n,).
    """
    from scipy.spatial.distance import pdist

    n, half = x.size, x.size // 2 + 1
    nearest = half * (half - 1) // 2 - 1
    distances = np.partition(pdist(x[:, None], "cityblock"), nearest)
    correction = n / (n + (1.4 if n % 2 else 3.8))
    if n - 2 < len(_QN_FEW):
        correction = _QN_FEW[n - 2]
    return _QN_TO_SD * correction * float(distances[nearest])


def _scores(
    measured: Mapping[str, Sequence[Mapping[str, float]]],
) -> dict[str, list[list[tuple[float, str]]]]:
    """Return score and text of every available measure of every trial.

    Args:
        measured: measures of the trials by terrain.
    """
    scores: dict[str, list[list[tuple[float, str]]]] = {
        name: [[] for _ in trials] for name, trials in measured.items()
    }
    for key, measure in MEASURES.items():
        available = {
            name: {k: row[key] for k, row in enumerate(trials) if key in row}
            for name, trials in measured.items()
        }
        enough = {n: rows for n, rows in available.items() if len(rows) >= _FEWEST}
        values = {name: np.array([*rows.values()]) for name, rows in enough.items()}
        scales = {name: qn_scale(x) for name, x in values.items()}
        for name, x in values.items():
            other_scales = [
                max(scale, measure.least)
                for other, scale in scales.items()
                if other != name
            ]
            for i, (k, value) in enumerate(enough[name].items()):
                others = np.delete(x, i)
                difference = value - float(np.median(others))
                # among many trials, leaving one out does not change the scale
                own = scales[name] if x.size > _MANY else qn_scale(others)
                if measure.is_known(own) and not other_scales:
                    z = difference / measure.least
                else:
                    scale = max(own, measure.least)
                    z = _normal_score(difference, scale, others.size, other_scales)
                scores[name][k].append((z / measure.limit, measure.text(difference)))
    return scores


def _normal_score(
    difference: float, scale: float, count: int, other_scales: Sequence[float]
) -> float:
    """Convert the difference of a trial to a normal score of equal probability.

    Args:
        difference: difference from the median of the others.
        scale: scale of the others.
        count: number of the others.
        other_scales: scales of other terrains.
    """
    from scipy.special import ndtri, stdtr

    common = math.exp(float(np.log(other_scales).mean())) if other_scales else scale
    variance = (count * scale**2 + _PRIOR * common**2) / (count + _PRIOR)
    t = difference / math.sqrt(variance * (1.0 + math.pi / (2 * count)))
    freedom = _QN_EFFICIENCY * (count - 1) + _PRIOR
    return math.copysign(float(ndtri(stdtr(freedom, -abs(t)))), difference)


def outlier_tables(study: Study) -> list[ReportTable]:
    """Return the table of outlier trials; none without outliers."""
    outliers = outlier_trials(study)
    if not outliers:
        return []
    table = ReportTable(
        name="Outlier trials",
        header=("terrain", "trial", "name", "times the limit", "why"),
        rows=[
            [
                trial.terrain,
                str(trial.number),
                trial.name,
                "implausible" if isinf(trial.score) else f"{trial.score:.1f}",
                "; ".join(trial.reasons),
            ]
            for trial in outliers[:_MOST_OUTLIERS]
        ],
        note="Normal score of the difference from the median of the terrain's other "
        f"trials, divided by its limit: {SENSOR_LIMIT:g} for measures of the sensor "
        f"alone, {PUSH_LIMIT:g} for measures that also depend on stones and hand. A "
        "trial whose motion and forces contradict each other is always listed. An "
        "outlier is not necessarily wrong: look at its curve, then decide."
        + (
            f" {len(outliers) - _MOST_OUTLIERS} more."
            if outliers[_MOST_OUTLIERS:]
            else ""
        ),
        section=ReportSection.SUMMARY,
    )
    return [table]
