"""Covariance functions of Gaussian processes, and how they compose.

A kernel over two sets of rows evaluates its matrix once and hands back, with it, a
function that contracts any weight matrix W with the derivatives: sum_ij W_ij
dK_ij/dtheta_k. No derivative matrix is ever formed, and a sum or product of kernels
needs only the contractions of its parts: W for a sum, W times the other's matrix for a
product.

A search evaluates the same rows some hundred times. Fresh memory of a few hundred rows
squared costs as much as what is computed in it, so an `Evaluator` keeps its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np

from analysis.data.series import Array

# W -> sum_ij W_ij dK_ij/dtheta_k, shape (p,); W may be overwritten
Contraction = Callable[[Array], Array]
# theta -> K and its contraction; both are good until the next call
Evaluator = Callable[[Array], tuple[Array, Contraction]]

_STRIP = 40  # rows of a triangle computed at a time
_LONGER = 3.0  # are the lengths of a second part, or equal parts would stay equal
_STRETCHES = (0.1, 0.35, 1.0, 3.5)  # l / sd(x) that a search may start with
ENDLESS = 10.0  # more in a logarithm than a search goes: to its bound
_LENGTHS = (-2.5, -1.2, 1.2, 2.5, ENDLESS)  # moves of log l; the last: not used


KERNELS: dict[str, type] = {}  # by name: results that are kept name their kernel


class Kernel(Protocol):
    """A covariance function with hyperparameters theta, natural logarithms."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters in the order of theta; sizes end in log_sf."""
        ...

    def matrix(self, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the covariances of the rows of X (n, d) and X_other (m, d): (n, m)."""
        ...

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return k(x, x) of every row of X, shape (n,)."""
        ...

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return what gives K, shape (n, m), and its contraction for any theta.

        Args:
            X: rows, shape (n, d).
            X_other: other rows, shape (m, d); None for the covariances of X with
                itself, of which only the upper triangle is good then, and the
                contraction is asked with upper triangles.
        """
        ...

    def design(self, sd_y: float, sd_x: Array) -> Sequence[Array]:
        """Return points that a search may start with, each of shape (p,)."""
        ...

    def moves(self, theta: Array) -> Sequence[Sequence[Array]]:
        """Return points that may belong to another top than theta, each (p,).

        They come in kinds. A search climbs from the likeliest of every kind in turn, of
        those that are not near to what it has reached by then.
        """
        ...

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of the search relative to the data, shape (p, 2)."""
        ...


class Composable:
    """Gives a kernel its matrix, `+` and `*`, and a place among the `KERNELS`."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        KERNELS[cls.__name__] = cls

    def matrix(self: Kernel, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the covariances of the rows of X (n, d) and X_other (m, d): (n, m)."""
        return self.over(X, X_other)(theta)[0]

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

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return sf^2 for every row."""
        return np.full(X.shape[0], np.exp(2.0 * theta[0]))

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return what gives K and its contraction for any theta."""
        return _SquaredExponentialOver(X, X_other)

    def design(self, sd_y: float, sd_x: Array) -> Sequence[Array]:
        """Return sf = sd(y)/2 with every pair of lengths."""
        return [
            np.log(np.concatenate([[0.5 * sd_y], lengths]))
            for lengths in length_pairs(sd_x)
        ]

    def moves(self, theta: Array) -> Sequence[Sequence[Array]]:
        """Return theta with one length changed, twice: the two likeliest are taken."""
        lengths = np.eye(theta.size)[1:]
        changed = [theta + size * length for length in lengths for size in _LENGTHS]
        return [changed, changed]

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return log sf in log sd(y) + [-6, 4], log l_d in log sd(x_d) + [-4, 6]."""
        centre = np.log(np.concatenate([[sd_y], sd_x]))
        span = np.array([[-6.0, 4.0]] + [[-4.0, 6.0]] * self.dimensions)
        return centre[:, None] + span


class _SquaredExponentialOver:
    """A squared exponential over two sets of rows, in memory of its own.

    The exponent is one matrix product, of (x / l^2, 2 log sf - |x/l|^2/2, -1/2 l^-2)
    and (x', 1, x' o x'); only the former changes with theta.
    """

    def __init__(self, X: Array, X_other: Array | None) -> None:
        other = X if X_other is None else X_other
        (n, d), m = X.shape, other.shape[0]
        self._X, self._squares = X, X * X
        self._parts = computed_parts(n, m, is_upper=X_other is None)
        self._left = np.empty((n, 2 * d + 1))
        self._right = np.vstack([other.T, np.ones(m), (other * other).T])
        self._K = np.empty((n, m))

    def __call__(self, theta: Array) -> tuple[Array, Contraction]:
        """Return K and its contraction.

        What rounding leaves above the largest exponent is cut off.
        """
        K, left, highest = self._K, self._left, 2.0 * theta[0]
        inverse = np.exp(-2.0 * theta[1:])
        d = inverse.size
        np.multiply(self._X, inverse, out=left[:, :d])
        left[:, d] = highest - 0.5 * (self._squares @ inverse)
        left[:, d + 1 :] = -0.5 * inverse
        np.matmul(left, self._right, out=K)
        for part in self._parts:
            np.minimum(K[part], highest, out=K[part])
            np.exp(K[part], out=K[part])
        return K, lambda W: self._contract(W, inverse)

    def _contract(self, W: Array, inverse: Array) -> Array:
        """Return sum_ij W_ij dK_ij/dtheta.

        With G = W o K: sum_ij G_ij (x_i - x'_j)^2 = (x o x)'(G 1) - 2 x'(G x')
        + 1'(G (x' o x')), so the lengths cost one product with G.
        """
        G, d = np.multiply(W, self._K, out=W), inverse.size
        sums = G @ self._right.T
        of_l = self._squares.T @ sums[:, d] + sums[:, d + 1 :].sum(axis=0)
        of_l -= 2.0 * np.einsum("nd,nd->d", self._X, sums[:, :d])
        return np.concatenate([[2.0 * sums[:, d].sum()], inverse * of_l])


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

    def moves(self, theta: Array) -> Sequence[Sequence[Array]]:
        """Return the moves of one part while the other stays."""
        a, b = self._split(theta)
        of_left = [
            [np.concatenate([move, b]) for move in kind] for kind in self.left.moves(a)
        ]
        of_right = [
            [np.concatenate([a, move]) for move in kind] for kind in self.right.moves(b)
        ]
        return [*of_left, *of_right]

    def _split(self, theta: Array) -> tuple[Array, Array]:
        count = len(self.left.names)
        return theta[:count], theta[count:]

    def _both(
        self, left: Evaluator, right: Evaluator, theta: Array
    ) -> tuple[tuple[Array, Contraction], tuple[Array, Contraction]]:
        a, b = self._split(theta)
        return left(a), right(b)


@dataclass(frozen=True, slots=True)
class Sum(_Pair):
    """k = k_left + k_right."""

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return the sum of the variances, shape (n,)."""
        a, b = self._split(theta)
        return self.left.diagonal(a, X) + self.right.diagonal(b, X)

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return what gives K and the contractions of both parts with the same W."""
        left, right = self.left.over(X, X_other), self.right.over(X, X_other)

        def at(theta: Array) -> tuple[Array, Contraction]:
            (K_left, of_left), (K_right, of_right) = self._both(left, right, theta)
            return K_left + K_right, lambda W: np.concatenate(
                [of_left(W.copy()), of_right(W)]
            )

        return at

    def design(self, sd_y: float, sd_x: Array) -> Sequence[Array]:
        """Return those of both side by side, the right ones with longer lengths."""
        return _side_by_side(
            self.left.design(sd_y, sd_x), self.right.design(sd_y, _LONGER * sd_x)
        )

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of both parts, shape (p, 2)."""
        return np.vstack([self.left.bounds(sd_y, sd_x), self.right.bounds(sd_y, sd_x)])


@dataclass(frozen=True, slots=True)
class Product(_Pair):
    """k = k_left k_right; the left part carries the unit of y."""

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return the product of the variances, shape (n,)."""
        a, b = self._split(theta)
        return self.left.diagonal(a, X) * self.right.diagonal(b, X)

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return what gives K and the contractions, each W weighed by the other's K."""
        left, right = self.left.over(X, X_other), self.right.over(X, X_other)

        def at(theta: Array) -> tuple[Array, Contraction]:
            (K_left, of_left), (K_right, of_right) = self._both(left, right, theta)
            return K_left * K_right, lambda W: np.concatenate(
                [of_left(W * K_right), of_right(W * K_left)]
            )

        return at

    def design(self, sd_y: float, sd_x: Array) -> Sequence[Array]:
        """Return those of both; the right part is dimensionless with sf = 1."""
        return _side_by_side(
            self.left.design(sd_y, sd_x), self.right.design(2.0, _LONGER * sd_x)
        )

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return the bounds of both parts, shape (p, 2)."""
        return np.vstack([self.left.bounds(sd_y, sd_x), self.right.bounds(1.0, sd_x)])


def computed_parts(n: int, m: int, *, is_upper: bool) -> list[tuple[slice, slice]]:
    """Return the parts of an (n, m) matrix that are computed, as (rows, columns).

    That is all of it, or rows from their place on the diagonal: a little more than the
    upper triangle. Exponentials cost as much as a factorisation.
    """
    if not is_upper:
        return [(slice(None), slice(None))]
    return [(slice(a, a + _STRIP), slice(a, m)) for a in range(0, n, _STRIP)]


def length_pairs(sd_x: Array) -> list[Array]:
    """Return lengths of d inputs, each of shape (d,), from rough to smooth.

    Two inputs get every pair of four lengths; further ones take turns with these two.
    """
    return [np.resize(pair, sd_x.size) * sd_x for pair in product(_STRETCHES, repeat=2)]


def _side_by_side(left: Sequence[Array], right: Sequence[Array]) -> list[Array]:
    """Return pairs of points; those of the shorter list are used again."""
    count = max(len(left), len(right))
    return [
        np.concatenate([left[k % len(left)], right[k % len(right)]])
        for k in range(count)
    ]
