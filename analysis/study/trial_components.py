"""Variance components: how trials of a terrain differ, and how rows repeat.

A Gaussian process with three components besides its function is fitted to rows of all
trials: a level of every trial (between), an Ornstein-Uhlenbeck residual along it
(within, with its time tau) and independent noise (measurement). Rows come in runs of
neighbours: single rows lie several tau apart, where residual and noise look alike.

Intervals come from trials drawn again with replacement, around the function fitted to
all of them. With J trials of T seconds the level of a terrain is known to

    sqrt((sc^2 + 2 so^2 tau / T) / J)
"""

import zlib
from dataclasses import dataclass

import numpy as np

from acquisition.errors import TractionError
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array, Indices
from analysis.gp.kernels import SquaredExponential
from analysis.gp.noise import ConstantNoise
from analysis.gp.regression import fit_gp
from analysis.gp.trial_noise import TrialNoise, TrialRows
from analysis.study.models import FitOptions
from analysis.tustin.identifiability import Interval

RUN = 5  # neighbours that are taken together
APART = 4  # kept samples from one to the next: nearer ones share the moving average
LEAST_GAIN = 1.4  # log likelihood that a level must gain: 5 % on the edge of its range

_STREAM = 3_000_000  # apart from folds, terrain fits and tables
_DRAWS = 100  # of trials with replacement, at most
_ENDS = (2.5, 97.5)  # % of the draws
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
    """

    trials: int
    seconds: float
    between: float
    within: float
    tau: float
    measurement: float
    intervals: dict[str, Interval]
    gain: float

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
    key = (task.options.seed, zlib.crc32(task.terrain.encode()), _STREAM)
    rng = np.random.default_rng(key)
    rows = [
        _runs(t, task.options.gp_points // len(task.trials), rng) for t in task.trials
    ]
    label = np.repeat(np.arange(len(rows)), [r.size for r in rows])
    F_n, v_t, F_t, t = (
        np.concatenate(
            [getattr(trial, n)[r] for trial, r in zip(task.trials, rows, strict=True)]
        )
        for n in ("F_n", "v_t", "F_t", "t")
    )
    inputs, trials = np.column_stack([F_n, v_t]), TrialRows(label, t)
    try:
        whole, without = (
            fit_gp(inputs, F_t, SquaredExponential(), noise, trials=trials)
            for noise in (
                TrialNoise(ConstantNoise(), has_drift=True),
                TrialNoise(ConstantNoise(), has_level=False, has_drift=True),
            )
        )
    except TractionError:
        return None
    theta = whole.theta[len(whole.kernel.names) :]
    residual = F_t - whole.mean(inputs)
    names = ("measurement", "between", "within", "tau")
    per_trial, draws = _PerTrial(residual, trials), min(task.options.draws, _DRAWS)
    intervals = _intervals(per_trial, theta, draws, rng) if draws else []
    point = dict(zip(names, np.exp(theta).tolist(), strict=True))
    return TrialComponents(
        trials=len(rows),
        seconds=float(np.mean([_motion(trial.t) for trial in task.trials])),
        **point,
        intervals=dict(zip(names, intervals, strict=bool(intervals))),
        gain=max(0.0, whole.lml - without.lml),
    )


def _runs(trial: TimedRows, count: int, rng: np.random.Generator) -> Indices:
    """Return `count` rows of a trial or fewer, in order, in runs of neighbours."""
    span = RUN * APART
    starts = np.arange(0, trial.t.size - span + 1, span)
    wanted = min(max(count // RUN, 1), starts.size)
    chosen = np.sort(rng.choice(starts, wanted, replace=False)) if wanted else starts
    return (chosen[:, None] + APART * np.arange(RUN)).ravel()


def _motion(t: Array) -> float:
    """Return how long the kept samples of a trial last together [s]."""
    return t.size * float(np.diff(t).min()) if t.size > 1 else 0.0


class _PerTrial:
    """The likelihood of residuals, trial by trial: these are independent.

    Shorter trials are padded with rows that add nothing.

    Args:
        residual: measured minus predicted force [N], shape (n,).
        trials: which trials the rows come from, and when.
    """

    def __init__(self, residual: Array, trials: TrialRows) -> None:
        blocks = trials.blocks()
        longest = max(rows.stop - rows.start for rows in blocks)
        shape = (len(blocks), longest)
        self._r, t, self._is_row = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        for k, rows in enumerate(blocks):
            count = rows.stop - rows.start
            self._r[k, :count], t[k, :count] = residual[rows], trials.t[rows]
            self._is_row[k, :count] = 1.0
        self._same = self._is_row[:, :, None] * self._is_row[:, None, :]
        self._gap = np.abs(t[:, :, None] - t[:, None, :])
        self.trials = len(blocks)

    def __call__(self, theta: Array) -> tuple[Array, Array]:
        """Return log likelihood of every trial, (J,), and its slopes, (J, 4).

        Args:
            theta: logarithms of sn, sc, so and tau.
        """
        sn, sc, so, tau = np.exp(theta)
        drift = so**2 * np.exp(-self._gap / tau) * self._same
        eye = np.eye(self._r.shape[1])
        noise = np.where(self._is_row > 0.0, sn**2, 1.0)[:, :, None] * eye
        C = noise + sc**2 * self._same + drift
        inverse = np.linalg.inv(C)
        a = np.einsum("kij,kj->ki", inverse, self._r)
        size = np.linalg.slogdet(C)[1]
        W = a[:, :, None] * a[:, None, :] - inverse
        diagonal = np.einsum("kii->ki", W) * self._is_row
        slopes = [
            sn**2 * diagonal.sum(axis=1),
            sc**2 * (W * self._same).sum(axis=(1, 2)),
            (W * drift).sum(axis=(1, 2)),
            0.5 * (W * drift * self._gap).sum(axis=(1, 2)) / tau,
        ]
        return -0.5 * ((self._r * a).sum(axis=1) + size), np.stack(slopes, axis=1)


def _intervals(
    per_trial: _PerTrial, theta: Array, draws: int, rng: np.random.Generator
) -> list[Interval]:
    """Return 95 % intervals of sn, sc, so and tau from trials drawn again.

    Args:
        per_trial: likelihood of every trial's residuals.
        theta: logarithms of the components of all trials.
        draws: of the trials with replacement.
        rng: draws them.
    """
    from scipy.optimize import minimize

    count = per_trial.trials
    bounds = np.column_stack([theta - 4.0, theta + 2.0])

    def likeliest(weight: Array, start: Array) -> Array:
        def cost(x: Array) -> tuple[float, Array]:
            values, slopes = per_trial(x)
            return -float(weight @ values), -(weight @ slopes)

        options = {"ftol": 1e-7, "maxiter": 60}
        return minimize(
            cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options
        ).x

    whole = likeliest(np.ones(count), theta)
    weights = rng.multinomial(count, np.full(count, 1.0 / count), size=draws)
    drawn = np.array([likeliest(weight, whole) for weight in weights.astype(float)])
    ends = np.exp(theta + np.percentile(drawn - whole, _ENDS, axis=0))
    return [Interval(*pair) for pair in ends.T.tolist()]
