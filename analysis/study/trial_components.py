"""Variance components of the residuals of a terrain, between and within trials.

A Gaussian process is fitted to rows of at most 30 trials. The residuals of all rows of
all trials have three components: the level of a trial (between), an Ornstein-Uhlenbeck
process along it (within, with correlation time tau) and independent noise
(measurement); see `analysis.gp.trial_level`.

Intervals come from a bootstrap over trials about the fixed function. With J trials of T
seconds the standard error of the level of a terrain is

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
    estimate_levels,
)
from analysis.gp.trial_noise import TrialNoise, TrialRows
from analysis.study.models import FitOptions
from analysis.study.new_trial import spread_rows
from analysis.tustin.identifiability import Interval

LEAST_GAIN = 1.4  # gain in log likelihood of a significant level: 5 %, at a boundary

_STREAM = 3_000_000  # random stream, distinct from folds, terrain fits and tables
_DRAWS = 100  # largest number of bootstrap draws
_ENDS = (2.5, 97.5)  # percentiles of the draws
_UNSEEN = 2  # rows per fitted row, so that most residuals are out of sample
_FEWEST = 3  # smallest number of trials


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
        """Take the kept samples of a trial."""
        return cls(trial.F_n, trial.v_t, trial.F_t, trial.smooth.t[trial.indices])


@dataclass(frozen=True, slots=True)
class ComponentsTask:
    """Input for the components of one terrain.

    Attributes:
        terrain: its name.
        trials: trials with kept samples.
        options: options of the fits.
    """

    terrain: str
    trials: tuple[TimedRows, ...]
    options: FitOptions


@dataclass(frozen=True, slots=True)
class TrialComponents:
    """Variance components of a terrain.

    Attributes:
        trials: number of trials.
        seconds: mean duration of motion in a trial [s].
        between: standard deviation between trials, sc [N].
        within: standard deviation of the correlated residual along a trial, so [N].
        tau: correlation time of that residual [s].
        measurement: standard deviation of single rows, sn [N].
        intervals: 95 % intervals of "between", "within", "tau" and "measurement";
            empty without draws.
        gain: gain in log likelihood from the trial level.
        other: sc [N] by the other of the two estimates; None if unavailable.
        do_differ: the two estimates differ by more than twice the standard error.
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
        """Whether the spread between trials is distinguishable from zero."""
        return self.gain >= LEAST_GAIN

    @property
    def independent(self) -> float:
        """Effective number of independent values in the residual of one trial."""
        return max(1.0, self.seconds / (2.0 * self.tau))

    def level_sd(self, trials: int) -> float:
        """Return the standard error of the terrain's level from `trials` trials [N]."""
        along = self.within**2 / self.independent
        return float(np.sqrt((self.between**2 + along) / trials))


def fit_components(task: ComponentsTask) -> TrialComponents | None:
    """Estimate the components of a terrain; None with fewer than three trials.

    Pure.
    """
    if len(task.trials) < _FEWEST:
        return None
    F_n, v_t, F_t = (
        np.concatenate([getattr(trial, n) for trial in task.trials])
        for n in ("F_n", "v_t", "F_t")
    )
    inputs, lengths = np.column_stack([F_n, v_t]), [t.t.size for t in task.trials]
    # in-sample residuals are too small, so most rows must not be fitted
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
    parts = np.split(F_t - process.mean(inputs), np.cumsum(lengths)[:-1])
    residuals = TrialResiduals(
        [(trial.t, part) for trial, part in zip(task.trials, parts, strict=True)]
    )
    levels = estimate_levels(residuals)
    components, likelihood = levels.components, RestrictedLikelihood(residuals)
    theta = components.theta()
    draws = min(task.options.draws, _DRAWS)
    key = (task.options.seed, zlib.crc32(task.terrain.encode()), _STREAM)
    rng = np.random.default_rng(key)
    return TrialComponents(
        trials=len(lengths),
        seconds=float(np.mean([_motion(trial.t) for trial in task.trials])),
        between=levels.between,
        within=components.within,
        tau=components.tau,
        measurement=components.measurement,
        intervals=_intervals(residuals, levels, draws, rng) if draws else {},
        gain=likelihood.gain(theta),
        other=levels.other,
        do_differ=levels.estimates_differ,
    )


def _motion(t: Array) -> float:
    """Return the total duration of the kept samples of a trial [s]."""
    return t.size * float(np.diff(t).min()) if t.size > 1 else 0.0


def _intervals(
    residuals: TrialResiduals,
    levels: TrialLevels,
    draws: int,
    rng: np.random.Generator,
) -> dict[str, Interval]:
    """Return 95 % bootstrap intervals of all components.

    Args:
        residuals: residuals of all trials.
        levels: estimate from all trials.
        draws: number of bootstrap draws.
        rng: random generator for the draws.
    """
    count, components = residuals.count, levels.components
    shares = np.full(count, 1.0 / count)
    weight = rng.multinomial(count, shares, size=draws).astype(float)
    theta = components.theta()
    drawn = RestrictedLikelihood(residuals).drawn(theta, weight)
    low, high = np.exp(np.percentile(drawn, _ENDS, axis=0)).tolist()
    names = ("measurement", "within", "tau")
    ends = {n: Interval(*pair) for n, *pair in zip(names, low, high, strict=True)}
    sums = LevelSums.of(residuals, REMEMBERED * components.tau)
    change = np.percentile(sums.drawn(weight) - sums.variance(), _ENDS)
    between = np.sqrt(np.maximum(levels.between**2 + change, 0.0)).tolist()
    return {"between": Interval(*between), **ends}
