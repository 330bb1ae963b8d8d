"""Covariance functions of Gaussian processes and their composition.

A kernel over two sets of rows evaluates its matrix once and returns with it a function
that contracts any weight matrix W with the derivatives: sum_ij W_ij dK_ij/dtheta_k. No
derivative matrix is ever formed. A sum or product of kernels needs only the
contractions of its parts: with W for a sum, W times the other matrix for a product.

A search evaluates the same rows about a hundred times. Allocating a matrix of a few
hundred rows costs as much as filling it, so an `Evaluator` reuses its memory.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np

from analysis.data.series import Array

# W -> sum_ij W_ij dK_ij/dtheta_k, shape (p,); W may be overwritten
Contraction = Callable[[Array], Array]
# theta -> K and its contraction; both are valid until the next call
Evaluator = Callable[[Array], tuple[Array, Contraction]]

_STRIP = 40  # rows of the upper triangle computed at a time


class Role(Enum):
    """Quantity of which a hyperparameter is the logarithm."""

    SIZE = "size"  # standard deviation of the function, in the unit of y
    LENGTH = "length"  # length scale of an input, in its unit
    BIAS = "bias"  # dimensionless


class Hyperparameter(NamedTuple):
    """One hyperparameter of a kernel, a natural logarithm.

    Attributes:
        name: name in records.
        role: quantity of which it is the logarithm.
        input: index of the input that a length scale belongs to.
    """

    name: str
    role: Role
    input: int = 0


class Kernel(Protocol):
    """A covariance function with hyperparameters theta, natural logarithms."""

    @property
    def parameters(self) -> tuple[Hyperparameter, ...]:
        """The hyperparameters in the order of theta."""
        ...

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

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return the evaluator of K, shape (n, m), and its contraction.

        Args:
            X: rows, shape (n, d).
            X_other: other rows, shape (m, d); None for the covariances of X with
                itself. Then only the upper triangle of K is valid, and the contraction
                expects upper-triangular weights.
        """
        ...


class Composable:
    """Mixin that provides names, matrix, `+` and `*` of a kernel."""

    __slots__ = ()

    @property
    def names(self: Kernel) -> tuple[str, ...]:
        """Names of the hyperparameters in the order of theta."""
        return tuple(parameter.name for parameter in self.parameters)

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
    def parameters(self) -> tuple[Hyperparameter, ...]:
        """The hyperparameters in the order of theta."""
        return (Hyperparameter("log_sf", Role.SIZE), *lengths_of(self.dimensions))

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return sf^2 for every row."""
        return np.full(X.shape[0], np.exp(2.0 * theta[0]))

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return the evaluator of K and its contraction."""
        return _SquaredExponentialOver(X, X_other)


class _SquaredExponentialOver:
    """Evaluator of a squared exponential over two sets of rows, in reused memory.

    The exponent is one matrix product, of (x / l^2, 2 log sf - |x/l|^2/2, -1/2 l^-2)
    and (x', 1, x' o x'); only the first factor depends on theta.
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

        The exponent is clipped at its maximum 2 log sf, which rounding may exceed.
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
    """Two kernels; theta holds the left one's hyperparameters, then the right one's."""

    left: Kernel
    right: Kernel

    @property
    def parameters(self) -> tuple[Hyperparameter, ...]:
        """Those of the left kernel, prefixed "a.", and of the right one, "b."."""
        left = (p._replace(name=f"a.{p.name}") for p in self.left.parameters)
        return (*left, *(p._replace(name=f"b.{p.name}") for p in self.right.parameters))

    def split(self, theta: Array) -> tuple[Array, Array]:
        """Split theta into the hyperparameters of both parts."""
        count = len(self.left.names)
        return theta[:count], theta[count:]

    def _both(
        self, left: Evaluator, right: Evaluator, theta: Array
    ) -> tuple[tuple[Array, Contraction], tuple[Array, Contraction]]:
        a, b = self.split(theta)
        return left(a), right(b)


@dataclass(frozen=True, slots=True)
class Sum(_Pair):
    """k = k_left + k_right."""

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return the sum of the variances, shape (n,)."""
        a, b = self.split(theta)
        return self.left.diagonal(a, X) + self.right.diagonal(b, X)

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return the evaluator of K; both parts are contracted with the same W."""
        left, right = self.left.over(X, X_other), self.right.over(X, X_other)

        def at(theta: Array) -> tuple[Array, Contraction]:
            (K_left, of_left), (K_right, of_right) = self._both(left, right, theta)
            return K_left + K_right, lambda W: np.concatenate(
                [of_left(W.copy()), of_right(W)]
            )

        return at


@dataclass(frozen=True, slots=True)
class Product(_Pair):
    """k = k_left k_right; the left part carries the unit of y."""

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return the product of the variances, shape (n,)."""
        a, b = self.split(theta)
        return self.left.diagonal(a, X) * self.right.diagonal(b, X)

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return the evaluator of K; W is weighted by the K of the other part."""
        left, right = self.left.over(X, X_other), self.right.over(X, X_other)

        def at(theta: Array) -> tuple[Array, Contraction]:
            (K_left, of_left), (K_right, of_right) = self._both(left, right, theta)
            return K_left * K_right, lambda W: np.concatenate(
                [of_left(W * K_right), of_right(W * K_left)]
            )

        return at


def computed_parts(n: int, m: int, *, is_upper: bool) -> list[tuple[slice, slice]]:
    """Return the parts of an (n, m) matrix that are computed, as (rows, columns).

    That is the whole matrix, or strips of rows from the diagonal on: slightly more than
    the upper triangle. All exponentials would cost as much as a factorisation.
    """
    if not is_upper:
        return [(slice(None), slice(None))]
    return [(slice(a, a + _STRIP), slice(a, m)) for a in range(0, n, _STRIP)]


def lengths_of(dimensions: int) -> tuple[Hyperparameter, ...]:
    """Return one length-scale hyperparameter per input."""
    return tuple(
        Hyperparameter(f"log_l{d + 1}", Role.LENGTH, d) for d in range(dimensions)
    )
