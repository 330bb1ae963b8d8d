"""Covariance functions of Gaussian processes.

A kernel evaluates its matrix once and hands back, with it, a function that contracts
any weight matrix W with the derivatives: 1/2 sum_ij W_ij dK_ij/dtheta_k. No derivative
matrix is ever formed, and a sum or product of kernels needs only the contractions of
its parts: W for a sum, W times the other's matrix for a product.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.series import Array

Contraction = Callable[[Array], Array]


class Kernel(Protocol):
    """A covariance function with hyperparameters theta, natural logarithms."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters in the order of theta."""
        ...

    def matrix(self, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the covariances of the rows of X (n, d) and X_other (m, d): (n, m)."""
        ...

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return k(x, x) of every row of X, shape (n,)."""
        ...

    def evaluate(self, theta: Array, X: Array) -> tuple[Array, Contraction]:
        """Return K, shape (n, n), and its contraction with a symmetric W (n, n)."""
        ...

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return a start of the search: lengths `stretch` standard deviations."""
        ...

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of the search relative to the data, shape (p, 2)."""
        ...


@dataclass(frozen=True, slots=True)
class SquaredExponential:
    """k = sf^2 exp(-1/2 sum_d (x_d - x'_d)^2 / l_d^2), one length per input (eq. 4).

    Attributes:
        dimensions: number of inputs d; theta = (log sf, log l_1 ... log l_d).
    """

    dimensions: int = 2

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters."""
        return ("log_sf", *(f"log_l{d + 1}" for d in range(self.dimensions)))

    def matrix(self, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the covariances of two sets of rows, shape (n, m)."""
        Z, Z_other = X / np.exp(theta[1:]), X_other / np.exp(theta[1:])
        exponent = np.zeros((X.shape[0], X_other.shape[0]))
        for column, other in zip(Z.T, Z_other.T, strict=True):
            difference = np.subtract.outer(column, other)
            difference *= difference
            exponent += difference
        exponent *= -0.5
        np.exp(exponent, out=exponent)
        exponent *= np.exp(2.0 * theta[0])
        return exponent

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return sf^2 for every row."""
        return np.full(X.shape[0], np.exp(2.0 * theta[0]))

    def evaluate(self, theta: Array, X: Array) -> tuple[Array, Contraction]:
        """Return K and its contraction.

        With G = W o K: sum_ij G_ij (x_i - x_j)^2 = 2 (x o x)'(G 1) - 2 x'(G x), so the
        lengths cost two products with G and no matrix of their own.
        """
        K = self.matrix(theta, X, X)
        Z = X / np.exp(theta[1:])

        def contract(W: Array) -> Array:
            G = W * K
            row_sums = G.sum(axis=1)
            slope_sf = row_sums.sum()
            slopes_l = (Z * Z).T @ row_sums - np.einsum("nd,nd->d", Z, G @ Z)
            return np.concatenate([[slope_sf], slopes_l])

        return K, contract

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return sf = sd(y), l_d = stretch sd(x_d)."""
        return np.log(np.concatenate([[sd_y], stretch * sd_x]))

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return log sf in log sd(y) + [-6, 4], log l_d in log sd(x_d) + [-4, 6]."""
        centre = np.log(np.concatenate([[sd_y], sd_x]))
        span = np.array([[-6.0, 4.0]] + [[-4.0, 6.0]] * self.dimensions)
        return centre[:, None] + span
