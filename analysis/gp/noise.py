"""Measurement noise of a Gaussian process."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.data.series import Array

_START = 0.8  # sn / sd(y) that the search starts with
_LARGEST_INPUT = 2.0  # standard deviations beyond which the noise stays constant


class Noise(Protocol):
    """Noise variance of every row, with its own hyperparameters theta."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters in the order of theta."""
        ...

    def variance(self, theta: Array, X: Array) -> Array:
        """Return the noise variance of every row of X (n, d), shape (n,)."""
        ...

    def evaluate(
        self, theta: Array, X: Array
    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return the variances S (n,) and 1/2 sum_i d_i dS_i/dtheta_k for any d."""
        ...

    def log_prior(self, theta: Array) -> tuple[float, Array]:
        """Return the log prior of theta and its slope."""
        ...

    def start(self, sd_y: float) -> Array:
        """Return the start of the search: constant noise of 0.8 sd(y)."""
        ...

    def bounds(self, sd_y: float) -> Array:
        """Return the bounds of the search relative to the data, shape (p, 2)."""
        ...


@dataclass(frozen=True, slots=True)
class ConstantNoise:
    """The same standard deviation sn everywhere; theta = (log sn,)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters."""
        return ("log_sn",)

    def variance(self, theta: Array, X: Array) -> Array:
        """Return sn^2 for every row."""
        return np.full(X.shape[0], np.exp(2.0 * theta[0]))

    def evaluate(
        self, theta: Array, X: Array
    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return sn^2 for every row and its contraction, sum_i d_i S_i."""
        S = self.variance(theta, X)
        return S, lambda d: np.array([d @ S])

    def log_prior(self, theta: Array) -> tuple[float, Array]:
        """Return zero: the prior of log sn is flat."""
        return 0.0, np.zeros(theta.size)

    def start(self, sd_y: float) -> Array:
        """Return sn = 0.8 sd(y)."""
        return np.log(np.array([_START * sd_y]))

    def bounds(self, sd_y: float) -> Array:
        """Return log sn in log sd(y) + [-6, 2]."""
        return np.log(sd_y) + np.array([[-6.0, 2.0]])


@dataclass(frozen=True, slots=True)
class LogLinearNoise:
    """log sn(x) = w_0 + sum_d w_d z_d, z the standardised inputs clipped to +-2.

    theta = (w_0, w_1 ... w_d). The slopes w_1 ... have a prior N(0, 1), because 300
    rows would otherwise be overfitted.

    Attributes:
        dimensions: number of inputs d.
    """

    dimensions: int = 2

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters."""
        return ("log_sn", *(f"w{d + 1}" for d in range(self.dimensions)))

    def variance(self, theta: Array, X: Array) -> Array:
        """Return sn(x)^2 of every row."""
        return np.exp(2.0 * (_features(X) @ theta))

    def evaluate(
        self, theta: Array, X: Array
    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return sn(x)^2 and its contraction, H'(d o S)."""
        H = _features(X)
        S = np.exp(2.0 * (H @ theta))
        return S, lambda d: H.T @ (d * S)

    def log_prior(self, theta: Array) -> tuple[float, Array]:
        """Return -1/2 sum_d w_d^2 and its slope; the prior of w_0 is flat."""
        slope = -theta
        slope[0] = 0.0
        return 0.5 * float(slope @ theta), slope

    def start(self, sd_y: float) -> Array:
        """Return a constant sn = 0.8 sd(y)."""
        return np.concatenate([[np.log(_START * sd_y)], np.zeros(self.dimensions)])

    def bounds(self, sd_y: float) -> Array:
        """Return w_0 in log sd(y) + [-6, 2] and the slopes within +-3."""
        slopes = [[-3.0, 3.0]] * self.dimensions
        return np.vstack([np.log(sd_y) + np.array([[-6.0, 2.0]]), slopes])


def _features(X: Array) -> Array:
    return np.column_stack(
        [np.ones(X.shape[0]), np.clip(X, -_LARGEST_INPUT, _LARGEST_INPUT)]
    )
