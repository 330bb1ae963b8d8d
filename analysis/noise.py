"""Noise of the measurements around a Gaussian process, apart from its covariance."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.series import Array


class Noise(Protocol):
    """A variance for every row, with hyperparameters theta of its own."""

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

    def start(self, sd_y: float, share: float) -> Array:
        """Return a start of the search: a standard deviation of `share` sd(y)."""
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

    def start(self, sd_y: float, share: float) -> Array:
        """Return sn = share sd(y)."""
        return np.log(np.array([share * sd_y]))

    def bounds(self, sd_y: float) -> Array:
        """Return log sn in log sd(y) + [-6, 2]."""
        return np.log(sd_y) + np.array([[-6.0, 2.0]])
