"""Variance components: how trials of a terrain differ, and how rows repeat.

Around a Gaussian process of rows of at most 30 trials the residuals of all rows of all
trials have three parts: a level of every trial (between), an Ornstein-Uhlenbeck
residual along it (within, with its time tau) and independent noise (measurement); see
`analysis.gp.trial_level`.

Intervals come from trials drawn again with replacement, around the function fitted to
all of them. With J trials of T seconds the level of a terrain is known to

    sqrt((sc^2 + 2 so^2 tau / T) / J)
"""

import zlib
from dataclasses import dataclass

import numpy as np

from acquisition.errors import TractionError
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.gp.kernels import SquaredExponential
from analysis.gp.noise import ConstantNoise
from analysis.gp.regression import fit_gp
from analysis.gp.trial_level import (
    REMEMBERED,
    LevelSums,
    RestrictedLikelihood,
    TrialLevels,
    TrialResiduals,
    levels_of,
)
from analysis.gp.trial_noise import TrialNoise, TrialRows
from analysis.study.models import FitOptions
from analysis.study.new_trial import spread_rows
from analysis.tustin.identifiability import Interval

LEAST_GAIN = 1.4  # log likelihood that a level must gain: 5 % on the edge of its range

_STREAM = 3_000_000  # apart from folds, terrain fits and tables
_DRAWS = 100  # of trials with replacement, at most
_ENDS = (2.5, 97.5)  # % of the draws
_UNSEEN = 2  # rows for each that the function is fitted to, to judge its residuals
_FEWEST = 3  # trials that a spread between them can be seen in


@dataclass(frozen=True, slots=True)
class TimedRows:
    """Kept samples of one trial with their time.

    Attributes:
        F_n: normal force [N], shape (n,).
        v_t: slip velocity [m/s], shape (n,).
        F_t: traction force [N], shape (n,).
        t: time [s], shape (n,).
    """

    F_n: Array
    v_t: Array
    F_t: Array
    t: Array

    @classmethod
    def of(cls, trial: PreparedTrial) -> "TimedRows":
        """Return the kept samples of a trial."""
        return cls(trial.F_n, trial.v_t, trial.F_t, trial.smooth.t[trial.indices])


@dataclass(frozen=True, slots=True)
class ComponentsTask:
    """Everything the components of one terrain need.

    Attributes:
        terrain: its name.
        trials: those that have kept samples.
        options: how to fit.
    """

    terrain: str
    trials: tuple[TimedRows, ...]
    options: FitOptions


@dataclass(frozen=True, slots=True)
class TrialComponents:
    """How trials of a terrain differ, and how the rows of one repeat each other.

    Attributes:
        trials: number of trials.
        seconds: mean motion of a trial [s].
        between: standard deviation between trials, sc [N].
        within: that of the residual along a trial, so [N].
        tau: its correlation time [s].
        measurement: standard deviation of single rows, sn [N].
        intervals: 95 % intervals of "between", "within", "tau" and "measurement";
            none where no draws were asked for.
        gain: log likelihood that the level of a trial gains.
        other: sc [N] by the other of the two ways; None where it says nothing.
        do_differ: the two ways differ by more than twice the standard error.
    """

    trials: int
    seconds: float
    between: float
    within: float
    tau: float
    measurement: float
    intervals: dict[str, Interval]
    gain: float
    other: float | None = None
    do_differ: bool = False

    @property
    def is_distinguishable(self) -> bool:
        """Whether the spread between trials can be told from none."""
        return self.gain >= LEAST_GAIN

    @property
    def independent(self) -> float:
        """Independent values that the residual of one trial is worth."""
        return max(1.0, self.seconds / (2.0 * self.tau))

    def level_sd(self, trials: int) -> float:
        """Return how well so many trials show the terrain's level [N]."""
        along = self.within**2 / self.independent
        return float(np.sqrt((self.between**2 + along) / trials))


def fit_components(task: ComponentsTask) -> TrialComponents | None:
    """Return the components of a terrain; None with fewer than three trials.

    A pure function of the task.
    """
    if len(task.trials) < _FEWEST:
        return None
    F_n, v_t, F_t = (
        np.concatenate([getattr(trial, n) for trial in task.trials])
        for n in ("F_n", "v_t", "F_t")
    )
    inputs, lengths = np.column_stack([F_n, v_t]), [t.t.size for t in task.trials]
    # residuals of rows that the function is fitted to are too small: most are not
    chosen = spread_rows(lengths, min(task.options.gp_points, sum(lengths) // _UNSEEN))
    label = np.repeat(np.arange(len(lengths)), lengths)[chosen]
    try:
        process = fit_gp(
            inputs[chosen],
            F_t[chosen],
            SquaredExponential(),
            TrialNoise(ConstantNoise()),
            trials=TrialRows(label),
        )
    except TractionError:
        return None
    left = np.split(F_t - process.mean(inputs), np.cumsum(lengths)[:-1])
    residuals = TrialResiduals(
        [(trial.t, part) for trial, part in zip(task.trials, left, strict=True)]
    )
    levels = levels_of(residuals)
    found, likelihood = levels.components, RestrictedLikelihood(residuals)
    theta = found.theta()
    draws = min(task.options.draws, _DRAWS)
    key = (task.options.seed, zlib.crc32(task.terrain.encode()), _STREAM)
    rng = np.random.default_rng(key)
    return TrialComponents(
        trials=len(lengths),
        seconds=float(np.mean([_motion(trial.t) for trial in task.trials])),
        between=levels.between,
        within=found.within,
        tau=found.tau,
        measurement=found.measurement,
        intervals=_intervals(residuals, levels, draws, rng) if draws else {},
        gain=likelihood.gain(theta),
        other=levels.other,
        do_differ=levels.do_differ,
    )


def _motion(t: Array) -> float:
    """Return how long the kept samples of a trial last together [s]."""
    return t.size * float(np.diff(t).min()) if t.size > 1 else 0.0


def _intervals(
    residuals: TrialResiduals,
    levels: TrialLevels,
    draws: int,
    rng: np.random.Generator,
) -> dict[str, Interval]:
    """Return 95 % intervals of all components from trials drawn again.

    Args:
        residuals: of all trials.
        levels: found from them.
        draws: of the trials with replacement.
        rng: draws them.
    """
    count, found = residuals.count, levels.components
    shares = np.full(count, 1.0 / count)
    weight = rng.multinomial(count, shares, size=draws).astype(float)
    theta = found.theta()
    drawn = RestrictedLikelihood(residuals).drawn(theta, weight)
    low, high = np.exp(np.percentile(drawn, _ENDS, axis=0)).tolist()
    names = ("measurement", "within", "tau")
    ends = {n: Interval(*pair) for n, *pair in zip(names, low, high, strict=True)}
    sums = LevelSums.of(residuals, REMEMBERED * found.tau)
    moved = np.percentile(sums.drawn(weight) - sums.variance(), _ENDS)
    around = np.sqrt(np.maximum(levels.between**2 + moved, 0.0)).tolist()
    return {"between": Interval(*around), **ends}
