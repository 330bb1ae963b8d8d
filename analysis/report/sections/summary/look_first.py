"""Trials to look at first: those that stand out among the trials of their terrain.

Of every trial some measures are taken, and each is compared with those of the other
trials of its terrain. Ten trials tell their spread badly, so the other terrains' counts
as some more of them (as in moderated t statistics, Smyth 2004, Statistical Applications
in Genetics and Molecular Biology 3):

    t = (x - median) / (s sqrt(1 + pi / (2 n))),  s^2 = (n s_1^2 + n0 s_0^2) / (n + n0)

s_1 is the scale Q_n of the others (Rousseeuw and Croux 1993, J. Am. Stat. Assoc. 88),
which bears several spoilt trials; s_0 is the geometric mean of that of other terrains;
a terrain by itself has its own. t becomes the normal value that is as rare. A trial is
named beyond the limit of a measure, or where its motion and forces cannot be right.
What a foot shows that stands, before anybody pushes, tells most of the sensor: its
weight and the noise hardly differ from trial to trial. Stones and hands do, and more
often far than normal values. Forces some milliseconds late do not show on plates.
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

_HAND = 0.15  # a hand differs by so much, or its double, from push to push [log]
SENSOR_LIMIT = 4.0  # of a normal value, in what only the sensor changes
PUSH_LIMIT = 5.0  # in what stones and hand change, too
_FEWEST = 4  # trials of a terrain that are compared
_PRIOR = 5.0  # trials that the scale of the other terrains counts as
_MANY = 30  # trials, beyond which the scale is that of all
# Q_n: to the standard deviation of normal values, of 2 to 9 of them, and how much of
# them it uses.
_QN_TO_SD = 2.2219
_QN_FEW = (0.399, 0.994, 0.512, 0.844, 0.611, 0.857, 0.669, 0.872)
_QN_EFFICIENCY = 0.8
_SMOOTH = "friction"  # a doubt that smooth ground raises; the ratio is compared
_TOLD = 3  # measures in one reason
_STANDING = 0.5  # s at the start in which the foot stands and nobody pushes yet
_FEWEST_ROWS = 50  # of them
_MOST_ODD = 10  # trials to look at first


@dataclass(frozen=True, slots=True)
class Measure:
    """What trials are compared by.

    Attributes:
        words: what stands out, in words.
        least: scale below which no difference counts.
        is_log: values are logarithms of a ratio.
        unit: of values that are none.
        limit: beyond which a trial is named, as a normal value.
    """

    words: str
    least: float
    is_log: bool = False
    unit: str = ""
    limit: float = PUSH_LIMIT

    def is_known(self, scale: float) -> bool:
        """Return whether trials differ by less than hands are known to."""
        return self.least == _HAND and scale < _HAND

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
    "noise": Measure(
        "change from sample to sample", _HAND, is_log=True, limit=SENSOR_LIMIT
    ),
    "lag": Measure("delay of the force", 1.0, unit="ms", limit=SENSOR_LIMIT),
    "rest_t": Measure("F_t of the foot that stands", 0.2, unit="N", limit=SENSOR_LIMIT),
    "rest_n": Measure("F_n of the foot that stands", 0.2, unit="N", limit=SENSOR_LIMIT),
    "rest_noise_t": Measure(
        "noise of F_t at rest", 0.05, is_log=True, limit=SENSOR_LIMIT
    ),
    "rest_noise_n": Measure(
        "noise of F_n at rest", 0.05, is_log=True, limit=SENSOR_LIMIT
    ),
}


@dataclass(frozen=True, slots=True)
class OddTrial:
    """A trial that stands out.

    Attributes:
        terrain: its terrain.
        number: of the trial on its terrain, from 1.
        name: of the trial.
        score: how far it stands out, 1 = at the limit of a measure; infinite where it
            cannot be right.
        reasons: what stands out, the farthest first.
    """

    terrain: str
    number: int
    name: str
    score: float
    reasons: tuple[str, ...]


def look_first(study: Study) -> list[OddTrial]:
    """Return the trials that stand out, the farthest first; none in a sound study."""
    measured = {
        name: [_measured(result, k) for k in range(len(result.trials))]
        for name, result in study.terrains.items()
    }
    compared = _compared(measured)
    odd: list[OddTrial] = []
    for name, result in study.terrains.items():
        for k, trial in enumerate(result.trials):
            doubts = [d.seen for d in doubts_of(trial) if d.name != _SMOOTH]
            ranked = sorted(compared[name][k], key=lambda found: -abs(found[0]))
            told = [text for share, text in ranked if abs(share) > 1.0][:_TOLD]
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


def qn_scale(x: Array) -> float:
    """Return the scale Q_n of values; about their standard deviation if normal.

    A quantile of the distances between any two, which half of the values may spoil.

    Args:
        x: two values at least, shape (n,).
    """
    from scipy.spatial.distance import pdist

    n, half = x.size, x.size // 2 + 1
    nearest = half * (half - 1) // 2 - 1
    apart = np.partition(pdist(x[:, None], "cityblock"), nearest)
    corrected = n / (n + (1.4 if n % 2 else 3.8))
    if n - 2 < len(_QN_FEW):
        corrected = _QN_FEW[n - 2]
    return _QN_TO_SD * corrected * float(apart[nearest])


def _compared(
    measured: Mapping[str, Sequence[Mapping[str, float]]],
) -> dict[str, list[list[tuple[float, str]]]]:
    """Return for every trial its score and words of every measure that it shows.

    Args:
        measured: measures of the trials, by terrain.
    """
    found: dict[str, list[list[tuple[float, str]]]] = {
        name: [[] for _ in trials] for name, trials in measured.items()
    }
    for key, measure in MEASURES.items():
        shown = {
            name: {k: each[key] for k, each in enumerate(trials) if key in each}
            for name, trials in measured.items()
        }
        known = {n: one for n, one in shown.items() if len(one) >= _FEWEST}
        values = {name: np.array([*one.values()]) for name, one in known.items()}
        scales = {name: qn_scale(x) for name, x in values.items()}
        for name, x in values.items():
            beside = [
                max(scale, measure.least)
                for other, scale in scales.items()
                if other != name
            ]
            for i, (k, value) in enumerate(known[name].items()):
                others = np.delete(x, i)
                away = value - float(np.median(others))
                # of many trials one more does not change the scale
                own = scales[name] if x.size > _MANY else qn_scale(others)
                if measure.is_known(own) and not beside:
                    z = away / measure.least
                else:
                    z = _normal(away, max(own, measure.least), others.size, beside)
                found[name][k].append((z / measure.limit, measure.text(away)))
    return found


def _normal(away: float, scale: float, count: int, beside: Sequence[float]) -> float:
    """Return the normal value that is as rare as a trial so far from the others.

    Args:
        away: from their median.
        scale: theirs.
        count: how many they are.
        beside: scales of other terrains.
    """
    from scipy.special import ndtri, stdtr

    common = math.exp(float(np.log(beside).mean())) if beside else scale
    variance = (count * scale**2 + _PRIOR * common**2) / (count + _PRIOR)
    t = away / math.sqrt(variance * (1.0 + math.pi / (2 * count)))
    freedom = _QN_EFFICIENCY * (count - 1) + _PRIOR
    return math.copysign(float(ndtri(stdtr(freedom, -abs(t)))), away)


def look_first_tables(study: Study) -> list[ReportTable]:
    """Return the trials that stand out, the farthest first; none where none does."""
    odd = look_first(study)
    if not odd:
        return []
    table = ReportTable(
        name="Look at these first",
        header=("terrain", "trial", "name", "times the limit", "why"),
        rows=[
            [
                trial.terrain,
                str(trial.number),
                trial.name,
                "cannot be right" if isinf(trial.score) else f"{trial.score:.1f}",
                "; ".join(trial.reasons),
            ]
            for trial in odd[:_MOST_ODD]
        ],
        note="Distance from the median of the terrain's other trials, as rare as a "
        "normal value so many standard deviations out. Its limit is "
        f"{SENSOR_LIMIT:g} in what only the sensor changes, {PUSH_LIMIT:g} in what "
        "stones and hand change, too; a trial whose motion and forces contradict each "
        "other is named in any case. One that stands out is not wrong by that: look at "
        "its curve, then decide."
        + (f" {len(odd) - _MOST_ODD} more." if odd[_MOST_ODD:] else ""),
        section=ReportSection.SUMMARY,
    )
    return [table]
