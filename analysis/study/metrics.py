"""Scores of predictions, and comparison of models."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.study.distribution import Distribution, checked_shares

_SMALLEST_SD = 1e-6  # N, lower limit for scoring an exact fit


class Prediction(NamedTuple):
    """Predicted F_t with a symmetric distribution.

    Attributes:
        mean: predicted F_t [N], shape (n,).
        sd: standard deviation of a measurement [N], noise included, shape (n,).
        nu: degrees of freedom of Student's t, above 2; infinite for a normal.
    """

    mean: Array
    sd: Array
    nu: float = np.inf

    @property
    def scale(self) -> Array:
        """Scale of Student's t for this standard deviation [N]; sd for a normal."""
        factor = 1.0 if np.isinf(self.nu) else np.sqrt((self.nu - 2.0) / self.nu)
        return factor * np.maximum(self.sd, _SMALLEST_SD)

    @property
    def point(self) -> Array:
        """Median [N], which is the mean of a symmetric distribution, shape (n,)."""
        return self.mean

    def cdf(self, F_t: Array) -> Array:
        """Return the probability of less than F_t [N], each (n,)."""
        from scipy.special import ndtr, stdtr

        z = (F_t - self.mean) / self.scale
        return ndtr(z) if np.isinf(self.nu) else stdtr(self.nu, z)

    def quantiles(self, shares: Sequence[float] | Array) -> Array:
        """Return the quantiles [N] at these probabilities, shape (q, n)."""
        from scipy.special import ndtri, stdtrit

        p = checked_shares(shares)
        z = ndtri(p) if np.isinf(self.nu) else stdtrit(self.nu, p)
        return self.mean + np.outer(z, self.scale)

    def log_density(self, F_t: Array) -> Array:
        """Return the log density of every measurement F_t [N], shape (n,)."""
        return log_density(F_t, self)

    def crps(self, F_t: Array) -> Array:
        """Return the continuous ranked probability score [N] of F_t, shape (n,)."""
        return crps(F_t, self)


class Score(NamedTuple):
    """Errors of one model on one trial.

    Attributes:
        mae: mean absolute error [N].
        rmse: root mean square error [N].
        coverage95: share of measurements inside the 95 % band [-].
        variance: mean predictive variance, noise included [N^2].
        nlpd: mean negative log predictive density [log of N].
        crps: mean continuous ranked probability score [N].
        coverage50: share of measurements inside the 50 % band [-].
        coverage90: share of measurements inside the 90 % band [-].
    """

    mae: float
    rmse: float
    coverage95: float
    variance: float
    nlpd: float
    crps: float
    coverage50: float
    coverage90: float


def score(F_t: Array, prediction: Distribution) -> Score:
    """Score a prediction of F_t [N], shape (n,) with n >= 1.

    The absolute error uses the median, the squared error the mean.
    """
    return Score(
        mae=float(np.abs(F_t - prediction.point).mean()),
        rmse=float(np.sqrt(np.mean((F_t - prediction.mean) ** 2))),
        coverage95=coverage(F_t, prediction, 0.95),
        variance=float(np.mean(prediction.sd**2)),
        nlpd=float(-np.mean(prediction.log_density(F_t))),
        crps=float(np.mean(prediction.crps(F_t))),
        coverage50=coverage(F_t, prediction, 0.50),
        coverage90=coverage(F_t, prediction, 0.90),
    )


def coverage(F_t: Array, prediction: Distribution, share: float) -> float:
    """Return the fraction of F_t [N] inside the central band of probability `share`."""
    return float(np.mean(np.abs(2.0 * prediction.cdf(F_t) - 1.0) <= share))


def log_density(F_t: Array, prediction: Prediction) -> Array:
    """Return the log density of every measurement F_t [N], shape (n,)."""
    from scipy.special import gammaln

    scale, nu = prediction.scale, prediction.nu
    z2 = ((F_t - prediction.mean) / scale) ** 2
    if np.isinf(nu):
        return -0.5 * z2 - np.log(scale) - 0.5 * np.log(2.0 * np.pi)
    constant = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(nu * np.pi)
    return constant - 0.5 * (nu + 1.0) * np.log1p(z2 / nu) - np.log(scale)


def crps(F_t: Array, prediction: Prediction) -> Array:
    """Return the continuous ranked probability score [N] of every F_t, shape (n,).

    The integral of (distribution - step)^2: normal and Student's t in closed form
    (Gneiting and Raftery 2007; Jordan, Krueger and Lerch 2019).
    """
    from scipy.special import beta, ndtr, stdtr

    scale, nu = prediction.scale, prediction.nu
    z = (F_t - prediction.mean) / scale
    density = scale * np.exp(log_density(F_t, prediction))
    if np.isinf(nu):
        return scale * (z * (2.0 * ndtr(z) - 1.0) + 2.0 * density - 1 / np.sqrt(np.pi))
    spread = 2.0 * np.sqrt(nu) / (nu - 1.0) * beta(0.5, nu - 0.5)
    spread /= beta(0.5, 0.5 * nu) ** 2
    tail = 2.0 * density * (nu + z * z) / (nu - 1.0)
    return scale * (z * (2.0 * stdtr(nu, z) - 1.0) + tail - spread)


_EXACT = 14  # trials up to which every pattern of signs is tried
_PATTERNS = 20_000  # random patterns for more trials


class PairedComparison(NamedTuple):
    """A paired comparison over trials.

    Attributes:
        difference: mean of second minus first.
        standard_error: standard error of that mean; None for one trial.
        p: probability of a mean difference this large if the models were equal.
        trials: number of trials with both values.
    """

    difference: float
    standard_error: float | None
    p: float
    trials: int


def compare(
    first: Sequence[float | None], second: Sequence[float | None]
) -> PairedComparison | None:
    """Compare the errors of two models per trial; None without a pair.

    Paired permutation test with the trial as independent unit. If the models are equal,
    the sign of every difference is random: p is the share of all sign patterns with a
    mean at least as large.
    """
    pairs = [
        (a, b)
        for a, b in zip(first, second, strict=True)
        if a is not None and b is not None
    ]
    if not pairs:
        return None
    difference = np.array([b - a for a, b in pairs])
    count, mean = difference.size, float(difference.mean())
    error = float(difference.std(ddof=1) / np.sqrt(count)) if count > 1 else None
    permuted = _signs(count) @ np.abs(difference) / count
    # tolerance, so that rounding cannot separate a pattern from its mirror image
    is_as_large = np.abs(permuted) >= abs(mean) * (1.0 - 1e-12)
    return PairedComparison(mean, error, float(np.mean(is_as_large)), count)


def clearly_best(nlpd: Array, least: float = 0.0) -> int:
    """Return the column of NLPD, (trials, k), that is clearly smallest; 0 if none is.

    A column other than the first must be better by one standard error over the trials
    and by `least` [nat].
    """
    gain = nlpd[:, :1] - nlpd
    error = gain.std(axis=0, ddof=1) / np.sqrt(len(gain)) if len(gain) > 1 else 0.0
    is_clear = gain.mean(axis=0) > np.maximum(error, least)
    mean = np.where(is_clear, nlpd.mean(axis=0), np.inf)
    mean[0] = nlpd[:, 0].mean()
    return int(np.argmin(mean))


def adjusted_by_holm(p_values: Sequence[float]) -> list[float]:
    """Adjust p values for multiple comparisons by Holm's method, in the order given.

    Step-down: the k-th smallest of m is multiplied by m - k + 1, monotonically. At the
    level 0.05 the probability of any false positive among all m is below 0.05.
    """
    order = sorted(range(len(p_values)), key=p_values.__getitem__)
    adjusted, highest = [0.0] * len(p_values), 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min(1.0, (len(p_values) - rank) * p_values[index]))
        adjusted[index] = highest
    return adjusted


def smallest_adjusted(pairs: Sequence[PairedComparison]) -> float:
    """Return the smallest p value that Holm's adjustment can give for these pairs.

    With n trials the pattern with all signs equal has p = 2/2^n: with ten trials, at
    most 25 comparisons leave a chance of any adjusted p below 0.05.
    """
    trials = min((pair.trials for pair in pairs), default=0)
    return min(1.0, len(pairs) * 2.0 ** (1 - trials))


def standard_error(values: Sequence[float | None]) -> float | None:
    """Return the standard error of the mean over trials; None with fewer than two."""
    present = [value for value in values if value is not None]
    if len(present) < 2:
        return None
    return float(np.std(present, ddof=1) / np.sqrt(len(present)))


def _signs(count: int) -> Array:
    if count <= _EXACT:
        return np.array(list(product((-1.0, 1.0), repeat=count)))
    return np.random.default_rng(0).choice([-1.0, 1.0], (_PATTERNS, count))
