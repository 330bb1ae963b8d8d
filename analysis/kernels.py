"""Covariance functions of Gaussian processes, and how they compose.

A kernel evaluates its matrix once and hands back, with it, a function that contracts
any weight matrix W with the derivatives: sum_ij W_ij dK_ij/dtheta_k. No derivative
matrix is ever formed, and a sum or product of kernels needs only the contractions of
its parts: W for a sum, W times the other's matrix for a product.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.series import Array

Contraction = Callable[[Array], Array]

_OTHER_STRETCH = 3.0  # of a second part's lengths, or equal parts would stay equal


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

    def evaluate(
        self, theta: Array, X: Array, X_other: Array
    ) -> tuple[Array, Contraction]:
        """Return K, shape (n, m), and its contraction with a W of the same shape."""
        ...

    def diagonal_slope(self, theta: Array, X: Array, w: Array) -> Array:
        """Return sum_i w_i dk(x_i, x_i)/dtheta_k, shape (p,)."""
        ...

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return a start of the search: lengths `stretch` standard deviations."""
        ...

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of the search relative to the data, shape (p, 2)."""
        ...


class Composable:
    """Gives a kernel `+` and `*`."""

    __slots__ = ()

    def __add__(self: Kernel, other: Kernel) -> "Sum":
        """Return the kernel of the sum of two independent functions."""
        return Sum(self, other)

    def __mul__(self: Kernel, other: Kernel) -> "Product":
        """Return the kernel of the product of two independent functions."""
        return Product(self, other)


@dataclass(frozen=True, slots=True)
class SquaredExponential(Composable):
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
        """Return the covariances of two sets of rows, shape (n, m).

        The exponent is one matrix product, -|z|^2/2 + z'z' - |z'|^2/2; what rounding
        leaves above zero is cut off.
        """
        lengths = np.exp(theta[1:])
        Z, Z_other = X / lengths, X_other / lengths
        half = 0.5 * np.einsum("nd,nd->n", Z, Z)
        half_other = 0.5 * np.einsum("nd,nd->n", Z_other, Z_other)
        K = np.column_stack([Z, -half, np.ones(half.size)]) @ np.vstack(
            [Z_other.T, np.ones(half_other.size), -half_other]
        )
        np.minimum(K, 0.0, out=K)
        np.exp(K, out=K)
        K *= np.exp(2.0 * theta[0])
        return K

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return sf^2 for every row."""
        return np.full(X.shape[0], np.exp(2.0 * theta[0]))

    def evaluate(
        self, theta: Array, X: Array, X_other: Array
    ) -> tuple[Array, Contraction]:
        """Return K and its contraction.

        With G = W o K: sum_ij G_ij (x_i - x'_j)^2 = (x o x)'(G 1) + (x' o x')'(G' 1)
        - 2 x'(G x'), so the lengths cost one product with G and no matrix of their own.
        """
        K = self.matrix(theta, X, X_other)
        lengths = np.exp(theta[1:])
        Z, Z_other = X / lengths, X_other / lengths
        augmented = np.column_stack([np.ones(Z_other.shape[0]), Z_other])

        def contract(W: Array) -> Array:
            G = W * K
            product = G @ augmented
            row_sums, column_sums = product[:, 0], G.sum(axis=0)
            slopes_l = (Z * Z).T @ row_sums + (Z_other * Z_other).T @ column_sums
            slopes_l -= 2.0 * np.einsum("nd,nd->d", Z, product[:, 1:])
            return np.concatenate([[2.0 * row_sums.sum()], slopes_l])

        return K, contract

    def diagonal_slope(self, theta: Array, X: Array, w: Array) -> Array:
        """Return 2 sf^2 sum_i w_i for sf and nothing for the lengths."""
        slope = np.zeros(theta.size)
        slope[0] = 2.0 * float(w @ self.diagonal(theta, X))
        return slope

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return sf = sd(y), l_d = stretch sd(x_d)."""
        return np.log(np.concatenate([[sd_y], stretch * sd_x]))

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return log sf in log sd(y) + [-6, 4], log l_d in log sd(x_d) + [-4, 6]."""
        centre = np.log(np.concatenate([[sd_y], sd_x]))
        span = np.array([[-6.0, 4.0]] + [[-4.0, 6.0]] * self.dimensions)
        return centre[:, None] + span


@dataclass(frozen=True, slots=True)
class _Pair(Composable):
    """Two kernels in one; theta is the left one's, then the right one's."""

    left: Kernel
    right: Kernel

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters, "a." before the left, "b." the right ones."""
        left = (f"a.{name}" for name in self.left.names)
        return (*left, *(f"b.{name}" for name in self.right.names))

    def _split(self, theta: Array) -> tuple[Array, Array]:
        count = len(self.left.names)
        return theta[:count], theta[count:]


@dataclass(frozen=True, slots=True)
class Sum(_Pair):
    """k = k_left + k_right."""

    def matrix(self, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the sum of the covariances, shape (n, m)."""
        a, b = self._split(theta)
        return self.left.matrix(a, X, X_other) + self.right.matrix(b, X, X_other)

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return the sum of the variances, shape (n,)."""
        a, b = self._split(theta)
        return self.left.diagonal(a, X) + self.right.diagonal(b, X)

    def evaluate(
        self, theta: Array, X: Array, X_other: Array
    ) -> tuple[Array, Contraction]:
        """Return K and the contractions of both parts with the same W."""
        a, b = self._split(theta)
        K, left = self.left.evaluate(a, X, X_other)
        K_right, right = self.right.evaluate(b, X, X_other)
        return K + K_right, lambda W: np.concatenate([left(W), right(W)])

    def diagonal_slope(self, theta: Array, X: Array, w: Array) -> Array:
        """Return the slopes of both parts, shape (p,)."""
        a, b = self._split(theta)
        left = self.left.diagonal_slope(a, X, w)
        return np.concatenate([left, self.right.diagonal_slope(b, X, w)])

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return both starts, the right one with longer lengths."""
        left = self.left.start(sd_y, sd_x, stretch)
        return np.concatenate(
            [left, self.right.start(sd_y, sd_x, _OTHER_STRETCH * stretch)]
        )

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of both parts, shape (p, 2)."""
        return np.vstack([self.left.bounds(sd_y, sd_x), self.right.bounds(sd_y, sd_x)])


@dataclass(frozen=True, slots=True)
class Product(_Pair):
    """k = k_left k_right; the left part carries the unit of y."""

    def matrix(self, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the product of the covariances, shape (n, m)."""
        a, b = self._split(theta)
        return self.left.matrix(a, X, X_other) * self.right.matrix(b, X, X_other)

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return the product of the variances, shape (n,)."""
        a, b = self._split(theta)
        return self.left.diagonal(a, X) * self.right.diagonal(b, X)

    def evaluate(
        self, theta: Array, X: Array, X_other: Array
    ) -> tuple[Array, Contraction]:
        """Return K and the contractions, each part's W weighed by the other's K."""
        a, b = self._split(theta)
        K, left = self.left.evaluate(a, X, X_other)
        K_right, right = self.right.evaluate(b, X, X_other)
        return K * K_right, lambda W: np.concatenate([left(W * K_right), right(W * K)])

    def diagonal_slope(self, theta: Array, X: Array, w: Array) -> Array:
        """Return the slopes of both parts, weighed by the other's variance."""
        a, b = self._split(theta)
        left = self.left.diagonal_slope(a, X, w * self.right.diagonal(b, X))
        right = self.right.diagonal_slope(b, X, w * self.left.diagonal(a, X))
        return np.concatenate([left, right])

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return both starts; the right part is dimensionless with sf = 1."""
        left = self.left.start(sd_y, sd_x, stretch)
        return np.concatenate(
            [left, self.right.start(1.0, sd_x, _OTHER_STRETCH * stretch)]
        )

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of both parts, shape (p, 2)."""
        return np.vstack([self.left.bounds(sd_y, sd_x), self.right.bounds(1.0, sd_x)])
