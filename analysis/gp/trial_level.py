"""Spread between the levels of trials, estimated from all residuals.

The residual of row i of trial q at time t_i is

    r_qi = u_q + e_qi + n_qi,    u_q ~ N(0, sc^2),    n_qi ~ N(0, sn^2)
    cov(e_qi, e_qj) = so^2 exp(-|t_i - t_j| / tau)

Two estimates of the spread between trials sc, both linear in the number of rows:

* moments: two rows of a trial further apart than the correlation time share only the
  level, so sc^2 is the mean of their products. Neither a distribution nor tau is
  assumed. Sums per trial suffice, so leaving out a trial costs nothing.
* the restricted likelihood (Patterson and Thompson 1971), by a scalar Kalman filter of
  e along every trial, applied to the residual and to a constant: with innovations a, h
  and variance v,  A = sum h^2/v,  B = sum h a/v,  C = sum a^2/v,  k = 1 + sc^2 A,

      -2 lml = sum_q [sum log v + log k + C - sc^2 B^2/k] - (sum B/k)^2 / sum A/k
               + log sum A/k
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array

FEW = 30  # trials below which the restricted likelihood is used, not the moments
APART = 0.1  # s, smallest spacing of the rows used
REMEMBERED = 4.0  # multiple of tau beyond which two rows share only the level
_TAUS = (0.02, 20.0)  # s
_START_TAU = 0.5  # s
_STEP = 1e-5  # finite-difference step of a logarithm for slopes
_WIDE = 1e-3  # finite-difference step of a logarithm for curvatures
_LEAST_CURVATURE = 1e-3  # relative to the largest curvature
_LEAST_PAIRS = 10  # pairs of distant rows below which the moments are unusable


class TrialResiduals:
    """Residuals and times of trials as padded arrays, one row per trial.

    Args:
        trials: increasing times [s] and residuals of every trial, each of shape (n,).
    """

    def __init__(self, trials: Sequence[tuple[Array, Array]]) -> None:
        kept = [_thinned(t, r) for t, r in trials if r.size]
        shape = (len(kept), max((r.size for _, r in kept), default=1))
        self.r, self.t = np.zeros(shape), np.zeros(shape)
        self.is_row = np.zeros(shape, dtype=bool)
        for k, (t, r) in enumerate(kept):
            self.r[k, : r.size], self.t[k, : r.size] = r, t
            self.is_row[k, : r.size] = True
        self.counts = self.is_row.sum(axis=1)
        self.means = self.r.sum(axis=1) / self.counts

    @property
    def count(self) -> int:
        """Number of trials."""
        return int(self.counts.size)

    def within(self) -> float:
        """Return the pooled variance of rows around their trial mean."""
        deviation = np.where(self.is_row, self.r - self.means[:, None], 0.0)
        rows = int(self.counts.sum()) - self.count
        return float((deviation**2).sum()) / max(rows, 1)


@dataclass(frozen=True, slots=True)
class LevelSums:
    """Sums over every trial for the moment estimate, each of shape (J,).

    Attributes:
        pairs: number of pairs of rows further apart than the correlation lasts.
        products: sum of the products of their residuals.
        sums: sum of the sums of their residuals.
        means: mean residual of the trial.
    """

    pairs: Array
    products: Array
    sums: Array
    means: Array

    @classmethod
    def of(cls, residuals: TrialResiduals, gap: float) -> "LevelSums":
        """Sum over pairs of rows more than `gap` [s] apart."""
        columns = np.zeros((3, residuals.count))
        for k, count in enumerate(residuals.counts):
            t, r = residuals.t[k, :count], residuals.r[k, :count]
            before = np.searchsorted(t, t - gap, "left")
            total = np.concatenate([[0.0], np.cumsum(r)])[before]
            columns[:, k] = before.sum(), r @ total, (r * before + total).sum()
        pairs, products, sums = columns
        return cls(pairs, products, sums, residuals.means)

    def variance(self) -> float:
        """Return sc^2; 0 where the moments are negative."""
        return float(_variance([part.sum() for part in self._parts()], self.means.size))

    def without_each(self) -> Array:
        """Return sc^2 without each of the trials, shape (J,)."""
        others = [part.sum() - part for part in self._parts()]
        return _variance(others, self.means.size - 1)

    def drawn(self, weight: Array) -> Array:
        """Return sc^2 of bootstrap draws of the trials, not below 0, shape (d,).

        Args:
            weight: number of times each trial was drawn, shape (d, J).
        """
        parts = [weight @ part for part in self._parts()]
        return _variance(parts, self.means.size)

    def error(self) -> float:
        """Return the jackknife standard error of sc^2 over the trials."""
        each, J = self.without_each(), self.means.size
        return float(np.sqrt((J - 1) / J * ((each - each.mean()) ** 2).sum()))

    def _parts(self) -> tuple[Array, ...]:
        return self.pairs, self.products, self.sums, self.means, self.means**2


def _variance(parts: Sequence[Array], J: int) -> Array:
    """Return sc^2 from sums over J trials, in the order of `LevelSums`."""
    pairs, products, sums, means, squares = parts
    R = means / J
    shared = (products - R * sums + R**2 * pairs) / np.maximum(pairs, 1.0)
    correction = (squares - J * R**2) / max(J - 1, 1) / J  # for the estimated mean
    return np.maximum(shared + correction, 0.0)


class LevelComponents(NamedTuple):
    """Standard deviations of the components of a residual.

    Attributes:
        between: spread of the levels of trials, sc.
        within: correlated part along a trial, so.
        tau: correlation time of that part [s].
        measurement: independent noise of single rows, sn.
    """

    between: float
    within: float
    tau: float
    measurement: float

    def theta(self) -> Array:
        """Return the logarithms of sn, sc, so and tau."""
        return np.log([self.measurement, self.between, self.within, self.tau])


@dataclass(frozen=True, slots=True)
class TrialLevels:
    """Spread between the levels of trials, and the level of each.

    Attributes:
        between: sc, the spread between trials, in the unit of the residuals.
        error: standard error of sc by the moments; None if they are unusable.
        is_by_moments: sc is by moments, else by the restricted likelihood.
        other: sc by the other of the two; None if unavailable.
        within: pooled standard deviation of rows within a trial.
        mean: mean level.
        components: components by the restricted likelihood.
        levels: shrunken levels of the trials (best linear predictors), shape (J,).
    """

    between: float
    error: float | None
    is_by_moments: bool
    other: float | None
    within: float
    mean: float
    components: LevelComponents
    levels: Array

    @property
    def estimates_differ(self) -> bool:
        """Whether the two estimates differ by more than twice the standard error."""
        if self.other is None or self.error is None:
            return False
        return abs(self.other - self.between) > 2.0 * self.error


def estimate_levels(residuals: TrialResiduals) -> TrialLevels:
    """Estimate the spread between trials and their levels from all residuals.

    Raises:
        ValueError: fewer than two trials.
    """
    if residuals.count < 2:
        raise ValueError("a spread between trials needs two of them")
    likelihood = RestrictedLikelihood(residuals)
    theta = likelihood.likeliest()
    components = _components(theta)
    sums = LevelSums.of(residuals, REMEMBERED * components.tau)
    has_pairs = float(sums.pairs.sum()) >= _LEAST_PAIRS
    moments = float(np.sqrt(sums.variance())) if has_pairs else None
    is_by_moments = moments is not None and residuals.count >= FEW
    between = moments if is_by_moments and moments is not None else components.between
    level, mean = likelihood.levels(theta, between)
    return TrialLevels(
        between=between,
        error=_error_of_root(sums.error(), between) if has_pairs else None,
        is_by_moments=is_by_moments,
        other=components.between if is_by_moments else moments,
        within=float(np.sqrt(residuals.within())),
        mean=mean,
        components=components,
        levels=level,
    )


class RestrictedLikelihood:
    """Restricted likelihood of residuals as a function of theta.

    theta holds the logarithms of sn, sc, so and tau.

    Args:
        residuals: residuals of all trials.
    """

    def __init__(self, residuals: TrialResiduals) -> None:
        self._residuals = residuals
        t, is_row = residuals.t, residuals.is_row
        gap = np.where(is_row, np.diff(t, axis=1, prepend=-np.inf), 0.0)
        self._columns = list(zip(residuals.r.T, gap.T, is_row.T, strict=True))
        rows = residuals.r[is_row]
        self._sd = max(float(rows.std()), 1e-9)

    def likeliest(self, start: Array | None = None, *, is_level: bool = True) -> Array:
        """Return the theta that maximises the restricted likelihood.

        Args:
            start: initial theta.
            is_level: estimate sc, too; otherwise it stays at the start.
        """
        from scipy.optimize import minimize

        sd = np.log(self._sd)
        if start is None:
            start = np.array([sd - 2.0, sd - 1.2, sd - 0.3, np.log(_START_TAU)])
        box = [(sd - 6.0, sd + 1.0)] * 3 + [tuple(np.log(_TAUS))]
        if not is_level:
            box[1] = (float(start[1]), float(start[1]))
        steps = np.vstack([np.zeros(start.size), _STEP * np.eye(start.size)])

        def cost(theta: Array) -> tuple[float, Array]:
            values = self.costs(theta + steps)
            return float(values[0]), (values[1:] - values[0]) / _STEP

        return minimize(
            cost,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=box,
            options={"ftol": 1e-7, "maxiter": 60},
        ).x

    def costs(self, theta: Array) -> Array:
        """Return minus the restricted log likelihood up to a constant, shape (p,).

        Args:
            theta: hyperparameters, shape (p, 4).
        """
        A, B, C, D = self._sums(theta)
        sc2 = np.exp(2.0 * theta[:, 1])[:, None]
        k = 1.0 + sc2 * A
        each = D + np.log(k) + C - sc2 * B**2 / k
        precision, sums = (A / k).sum(axis=1), (B / k).sum(axis=1)
        return 0.5 * (each.sum(axis=1) - sums**2 / precision + np.log(precision))

    def drawn(self, theta: Array, weight: Array) -> Array:
        """Return theta without sc for bootstrap draws by one Newton step, shape (d, 3).

        Args:
            theta: optimum for all trials.
            weight: number of times each trial was drawn, shape (d, J).
        """
        free, _, mean = [0, 2, 3], *self.levels(theta, float(np.exp(theta[1])))
        steps = _WIDE * np.eye(4)[free]
        at = [theta, *(theta + s for s in steps), *(theta - s for s in steps)]
        pairs = [theta + a + b for a in steps for b in steps]
        costs = self._trial_costs(np.array([*at, *pairs]), mean)
        slopes = (costs[1:4] - costs[4:7]).T / (2.0 * _WIDE)
        total = costs.sum(axis=1)
        mixed = total[7:].reshape(3, 3) - total[1:4, None] - total[1:4] + total[0]
        curvature = mixed / _WIDE**2
        least = _LEAST_CURVATURE * max(float(np.abs(curvature).max()), 1.0)
        values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
        inverse = vectors / np.maximum(values, least) @ vectors.T
        return theta[free] - (weight - 1.0) @ slopes @ inverse

    def _trial_costs(self, theta: Array, mean: float) -> Array:
        """Return the cost of every trial around a given mean at p thetas, (p, J)."""
        A, B, C, D = self._sums(theta)
        sc2 = np.exp(2.0 * theta[:, 1])[:, None]
        k, around = 1.0 + sc2 * A, B - mean * A
        squares = C - 2.0 * mean * B + mean**2 * A
        return 0.5 * (D + np.log(k) + squares - sc2 * around**2 / k)

    def gain(self, theta: Array) -> float:
        """Return the gain in log likelihood from a level per trial."""
        without = theta.copy()
        without[1] = np.log(self._sd) - 6.0
        fixed = self.likeliest(start=without, is_level=False)
        costs = self.costs(np.array([fixed, theta]))
        return max(0.0, float(costs[0] - costs[1]))

    def levels(self, theta: Array, between: float) -> tuple[Array, float]:
        """Return the level of every trial about the mean, shape (J,), and the mean."""
        A, B = self._sums(theta[None, :])[:2, 0]
        k = 1.0 + between**2 * A
        mean = float((B / k).sum() / (A / k).sum())
        return between**2 * (B - A * mean) / k, mean

    def _sums(self, theta: Array) -> Array:
        """Return A, B, C and D of every trial at p thetas, shape (4, p, J).

        A scalar Kalman filter runs along all trials at once; D = sum log v.
        """
        sn2, _, so2, _ = np.exp(2.0 * theta.T)[:, :, None]
        tau, shape = np.exp(theta[:, 3:]), (theta.shape[0], self._residuals.count)
        # predicted mean of e for the residual and for a constant input
        mean, variance = np.zeros((2, *shape)), np.broadcast_to(so2, shape)
        sums = np.zeros((4, *shape))
        for r, gap, is_row in self._columns:
            rho = np.exp(-gap / tau)
            mean *= rho
            variance = so2 + rho**2 * (variance - so2)
            v = variance + sn2
            a, h = r - mean[0], 1.0 - mean[1]
            over = np.where(is_row, 1.0 / v, 0.0)
            sums[0] += h * h * over
            sums[1] += h * a * over
            sums[2] += a * a * over
            sums[3] += np.where(is_row, np.log(v), 0.0)
            gain = variance * over
            mean[0] += gain * a
            mean[1] += gain * h
            variance = variance * (1.0 - gain)
        return sums


def _error_of_root(error: float, root: float) -> float:
    """Convert the standard error of a square to that of its root (delta method)."""
    return error / max(2.0 * root, float(np.sqrt(error)), 1e-12)


def _components(theta: Array) -> LevelComponents:
    sn, sc, so, tau = np.exp(theta).tolist()
    return LevelComponents(between=sc, within=so, tau=tau, measurement=sn)


def _thinned(t: Array, r: Array) -> tuple[Array, Array]:
    """Thin rows to one per 0.1 s."""
    number = np.floor((t - t[0]) / APART + 1e-6)
    rows = np.flatnonzero(np.diff(number, prepend=-1.0) > 0.0)
    return t[rows], r[rows]
