"""What the trials so far know about a target, and what further ones would add.

A Gaussian process of F_t over (F_n, v_t) with three parts besides its function: a level
of every trial sc, an Ornstein-Uhlenbeck residual along it (so, tau) and noise sn. The
residual matters: without it a few hundred rows look like as many measurements, and
every push looks worthless. Hyperparameters are the likeliest under normal priors on
their logarithms, as a handful of trials does not show them.

The rows B of a further trial would lower the variance v_g of the function at point g of
the target to v_g|B, whatever forces they show (Lindley 1956; MacKay 1992):

    gain = 1/2 sum_g log(v_g / v_g|B)

and its mean would move there by sqrt(v_g - v_g|B), one standard deviation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import TractionError
from analysis.data.series import Array
from analysis.data.terrain_kinds import FLAT
from analysis.gp.hierarchy import prior_of
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Likelihood, factorise
from analysis.gp.noise import ConstantNoise
from analysis.gp.trial_noise import TrialNoise, TrialRows
from analysis.next_push.records import PushRecord

MOST_TRIALS = 16  # the newest that are looked at: 400 rows

_CENTRE, _SCALE = np.array([4.0, 0.05]), np.array([2.0, 0.04])  # of the inputs
# log sf, l1, l2, sn, sc, so, tau: means and standard deviations of their priors
_STONES = (
    (1.6, 0.7),
    (0.7, 0.7),
    (0.7, 0.7),
    (-1.2, 0.7),
    (0, 0),
    (1.1, 0.5),
    (-0.7, 0.5),
)
_PLATE = (
    (1.1, 0.7),
    (0.7, 0.7),
    (0.7, 0.7),
    (-1.9, 0.7),
    (0, 0),
    (-1.4, 0.7),
    (0.4, 0.7),
)
_SC = {False: 10, True: 11}  # indices in the priors of all ground: stones, plates
_SEARCHED_SDS = 4.0  # prior standard deviations that the search goes
_HOPELESS = 1e25
_SMALLEST = 1e-12  # variance that rounding may leave [N^2]
_NOISE = TrialNoise(ConstantNoise(), has_drift=True)
_KERNEL = SquaredExponential()


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """The process given the trials so far.

    Attributes:
        records: the trials.
        theta: log sf, l1, l2, sn, sc, so, tau.
        half: L^-1 of the rows' covariance, shape (n, n).
        alpha: C^-1 (F_t - offset), shape (n,).
        offset: mean F_t [N].
    """

    records: Sequence[PushRecord]
    theta: Array
    half: Array
    alpha: Array
    offset: float

    @classmethod
    def of(cls, records: Sequence[PushRecord], kind: str) -> "Knowledge":
        """Return what trials know, hyperparameters included.

        Args:
            records: the trials.
            kind: "flat" for a plate; anything else counts as stones.

        Raises:
            SettingsError: their covariance cannot be factorised.
        """
        records = records[-MOST_TRIALS:]
        F_t = np.concatenate([r.F_t for r in records])
        return cls.at(records, _likeliest(records, F_t - F_t.mean(), kind))

    @classmethod
    def at(cls, records: Sequence[PushRecord], theta: Array) -> "Knowledge":
        """Return what trials know with given hyperparameters.

        Raises:
            SettingsError: their covariance cannot be factorised.
        """
        F_t = np.concatenate([r.F_t for r in records])
        offset = float(F_t.mean())
        C = _within(theta, records)
        factor = factorise(C, np.zeros(len(C)))
        half = factor.half(np.eye(len(C)))
        alpha = half.T @ (half @ (F_t - offset))
        return cls(records, theta, half, alpha, offset)

    @property
    def level_spread(self) -> float:
        """How much the levels of single trials differ, their residual included [N].

        sqrt(sc^2 + 2 so^2 tau / T), T the mean duration of a trial.
        """
        sc, so, tau = np.exp(self.theta[4:])
        seconds = float(np.mean([np.ptp(r.t) for r in self.records]))
        along = so**2 * min(1.0, 2.0 * tau / max(seconds, 1e-3))
        return float(np.sqrt(sc**2 + along))

    def function(self, inputs: Array) -> tuple[Array, Array]:
        """Return mean [N] and variance [N^2] of the function at inputs (m, 2)."""
        cross = self._cross(inputs)
        V = self.half @ cross
        prior = np.exp(2.0 * self.theta[0])
        variance = np.maximum(prior - (V * V).sum(axis=0), _SMALLEST)
        return self.offset + self.alpha @ cross, variance

    def new_trial(self, inputs: Array) -> tuple[Array, Array]:
        """Return mean [N] and variance [N^2] of samples of a new trial."""
        mean, variance = self.function(inputs)
        return mean, variance + np.exp(2.0 * self.theta[3:6]).sum()

    def variance_after(
        self, inputs: Array, further: Sequence[Sequence[PushRecord]]
    ) -> Array:
        """Return the variance of the function after further trials [N^2], (k, m).

        Args:
            inputs: m points (F_n [N], v_t [m/s]), shape (m, 2).
            further: k alternatives, each of one or more trials; forces are not used.
        """
        k_g = _KERNEL.matrix(self.theta[:3], _standard(inputs), _standard(inputs))
        V_g = self.half @ self._cross(inputs)
        variance = np.diagonal(k_g) - (V_g * V_g).sum(axis=0)
        after = np.empty((len(further), len(inputs)))
        for k, trials in enumerate(further):
            rows = _inputs(trials)
            V_b = self.half @ self._cross(rows)
            S = _within(self.theta, trials) - V_b.T @ V_b
            c = _KERNEL.matrix(self.theta[:3], _standard(inputs), _standard(rows))
            c -= V_g.T @ V_b
            after[k] = variance - np.einsum("gb,bg->g", c, np.linalg.solve(S, c.T))
        return np.maximum(after, _SMALLEST)

    def _cross(self, inputs: Array) -> Array:
        rows = _standard(_inputs(self.records))
        return _KERNEL.matrix(self.theta[:3], rows, _standard(inputs))


def _likeliest(records: Sequence[PushRecord], r: Array, kind: str) -> Array:
    """Return theta of the largest posterior density.

    Raises:
        SettingsError: the covariance cannot be factorised.
    """
    from scipy.optimize import minimize

    mean, sd = _prior(kind)
    X = _standard(_inputs(records))
    likelihood = Likelihood(_KERNEL, _NOISE, X, r, _trial_rows(records))

    def downhill(theta: Array) -> tuple[float, Array]:
        try:
            lml, slope = likelihood(theta)
        except TractionError:
            return _HOPELESS, np.zeros_like(theta)
        far = (theta - mean) / sd
        return 0.5 * float(far @ far) - lml, far / sd - slope

    bounds = mean[:, None] + sd[:, None] * [-_SEARCHED_SDS, _SEARCHED_SDS]
    options = {"maxiter": 40, "ftol": 1e-5}
    best = minimize(
        downhill, mean, jac=True, method="L-BFGS-B", bounds=bounds, options=options
    )
    return np.asarray(best.x)


def _prior(kind: str) -> tuple[Array, Array]:
    """Return means and standard deviations of the priors; sc is that of all ground."""
    mean, sd = np.array(_PLATE if kind == FLAT else _STONES, dtype=float).T
    of_all, sd_of_all = prior_of(1.0)
    index = _SC[kind == FLAT]
    mean[4], sd[4] = of_all[index], sd_of_all[index]
    return mean, sd


def _within(theta: Array, records: Sequence[PushRecord]) -> Array:
    """Return the covariance of the rows of trials, noise included, shape (n, n)."""
    X, trials = _standard(_inputs(records)), _trial_rows(records)
    C = _KERNEL.matrix(theta[:3], X, X)
    for rows, block in _NOISE.shared(X, trials)(theta[3:]).blocks:
        C[rows, rows] += block
    C.flat[:: len(C) + 1] += np.exp(2.0 * theta[3])
    return C


def _inputs(records: Sequence[PushRecord]) -> Array:
    columns = [np.concatenate([getattr(r, n) for r in records]) for n in ("F_n", "v_t")]
    return np.column_stack(columns)


def _trial_rows(records: Sequence[PushRecord]) -> TrialRows:
    label = np.repeat(np.arange(len(records)), [r.t.size for r in records])
    return TrialRows(label, np.concatenate([r.t for r in records]))


def _standard(inputs: Array) -> Array:
    return (inputs - _CENTRE) / _SCALE
