"""The arcsine covariance of an infinite neural network (eq. 5).

p(x) = beta + 2 sum_d x_d^2/l_d^2,  N(x, x') = beta + 2 sum_d x_d x'_d/l_d^2
k(x, x') = sf^2 asin(N / sqrt((c + p(x)) (c + p(x'))))

c = 1 is the covariance of a network (Rasmussen and Williams 2006, eq. 4.29, with
beta = 2 sigma_0^2 and their 2/pi inside sf). c = 0 is eq. (5) as printed: there k(x, x)
is constant and the arcsine has a cusp at zero distance, so functions are very rough.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.gp.kernels import (
    Composable,
    Contraction,
    Evaluator,
    Hyperparameter,
    Role,
    computed_parts,
    lengths_of,
)

Part = tuple[slice, slice]  # rows and columns of a matrix that are computed

_ROOT_2 = np.sqrt(2.0)


class Augmented(NamedTuple):
    """Augmented rows U = (sqrt(beta), sqrt(2) x/l), shape (n, 1 + d), and A = c + U'U.

    Attributes:
        U: augmented rows.
        A: c + p of every row, shape (n,).
    """

    U: Array
    A: Array


@dataclass(frozen=True, slots=True)
class Arcsine(Composable):
    """The neural-network kernel, one length per input.

    Attributes:
        dimensions: number of inputs d; theta = (log sf, log l_1 ... log l_d, log beta).
        as_printed: c = 0 instead of 1.
    """

    dimensions: int = 2
    as_printed: bool = False

    @property
    def parameters(self) -> tuple[Hyperparameter, ...]:
        """The hyperparameters in the order of theta."""
        return (
            Hyperparameter("log_sf", Role.SIZE),
            *lengths_of(self.dimensions),
            Hyperparameter("log_beta", Role.BIAS),
        )

    @property
    def c(self) -> float:
        """Constant added to both factors under the root [-]."""
        return 0.0 if self.as_printed else 1.0

    def rows(self, theta: Array, X: Array) -> Augmented:
        """Return the augmented rows of X (n, d) at theta."""
        bias = np.full(X.shape[0], np.exp(0.5 * theta[-1]))
        U = np.column_stack([bias, _ROOT_2 * X / np.exp(theta[1:-1])])
        return Augmented(U, self.c + np.einsum("na,na->n", U, U))

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return sf^2 asin(p/(c + p)) of every row."""
        A = self.rows(theta, X).A
        return np.exp(2.0 * theta[0]) * np.arctan2(
            A - self.c, np.sqrt(self.c * (2.0 * A - self.c))
        )

    def over(self, X: Array, X_other: Array | None = None) -> Evaluator:
        """Return the evaluator of K and its contraction."""
        other = X if X_other is None else X_other
        parts = computed_parts(len(X), len(other), is_upper=X_other is None)
        over = _PrintedOver if self.as_printed else _NetworkOver
        return over(self, X, other, parts)


class _NetworkOver:
    """Evaluator for c = 1 over two sets of rows, in preallocated memory.

    With V = U / sqrt(A) the sine is u = V V'. Because 1 - u^2 exceeds 1/(1 + p), at
    most log10(1 + p) digits are lost to cancellation: five at the steepest.
    """

    def __init__(
        self, kernel: Arcsine, X: Array, X_other: Array, parts: Sequence[Part]
    ) -> None:
        self._kernel, self._rows, self._parts = kernel, (X, X_other), parts
        shape = len(X), len(X_other)
        self._K, self._u = np.zeros(shape), np.empty(shape)

    def __call__(self, theta: Array) -> tuple[Array, Contraction]:
        """Return K = sf^2 asin(u) and its contraction."""
        V, V_other = (self._scaled(theta, X) for X in self._rows)
        sf2, K, u = float(np.exp(2.0 * theta[0])), self._K, self._u
        np.matmul(V, np.ascontiguousarray(V_other.T), out=u)
        for part in self._parts:
            np.arcsin(u[part], out=K[part])
            K[part] *= sf2
        return K, lambda W: self._contract(W, sf2, V, V_other)

    def _scaled(self, theta: Array, X: Array) -> Array:
        rows = self._kernel.rows(theta, X)
        return rows.U / np.sqrt(rows.A)[:, None]

    def _contract(self, W: Array, sf2: float, V: Array, V_other: Array) -> Array:
        """Return sum_ij W_ij dK_ij/dtheta.

        For any parameter t, dk/dt = sf^2 [dN/dt / sqrt(A A') - u/2 (dA/dt / A +
        dA'/dt / A')] / sqrt(1 - u^2). So only q = W / sqrt(1 - u^2), q u and their
        products with V are needed.
        """
        of_sf, u = 2.0 * float(np.vdot(W, self._K)), self._u
        for part in self._parts:
            sine = u[part]
            W[part] /= np.sqrt(1.0 - sine * sine)
        of_shape = 2.0 * np.einsum("na,na->a", V, W @ V_other)
        r = np.multiply(W, u, out=W)
        of_shape -= r.sum(axis=1) @ (V * V) + r.sum(axis=0) @ (V_other * V_other)
        return _slopes(of_sf, sf2 * of_shape)


class _PrintedOver:
    """Evaluator for c = 0, as printed, over two sets of rows in preallocated memory.

    The sine is 1 for repeated rows, so the angle comes from the tangent N / D with
    D = sqrt(A A' - N^2). The parts of D that depend only on the rows are computed once:
    by Lagrange's identity D^2 = sum_{a<b} (U_a U'_b - U_b U'_a)^2, and with beta and
    the lengths factored out these are squares of x_a - x'_a and x_a x'_b - x_b x'_a.
    The latter is written as x_b (x_a - x'_a) - x_a (x_b - x'_b), so nothing cancels
    where two rows are close.
    """

    def __init__(
        self, kernel: Arcsine, X: Array, X_other: Array, parts: Sequence[Part]
    ) -> None:
        self._kernel = kernel
        self._X, self._X_other, self._parts = X, X_other, parts
        shape, d = (X.shape[0], X_other.shape[0]), X.shape[1]
        self._pairs = [(a, b) for a in range(d) for b in range(a + 1, d)]
        self._squares = np.empty((d + len(self._pairs), *shape))
        steps = [np.subtract.outer(X[:, a], X_other[:, a]) for a in range(d)]
        for a, b in self._pairs:
            steps.append(X[:, b, None] * steps[a] - X[:, a, None] * steps[b])
        for step, square in zip(steps, self._squares, strict=True):
            np.multiply(step, step, out=square)
        self._K, self._N, self._D = (np.zeros(shape) for _ in range(3))

    def __call__(self, theta: Array) -> tuple[Array, Contraction]:
        """Return K and its contraction, with asin(u) = atan(N / D)."""
        rows = self._kernel.rows(theta, self._X)
        others = self._kernel.rows(theta, self._X_other)
        sf2, K, D = float(np.exp(2.0 * theta[0])), self._K, self._D
        np.matmul(rows.U, np.ascontiguousarray(others.U.T), out=self._N)
        self._fill_squares(theta)
        for part in self._parts:
            np.sqrt(D[part], out=D[part])
            with np.errstate(divide="ignore"):  # repeated inputs: pi/2
                np.divide(self._N[part], D[part], out=K[part])
            np.arctan(K[part], out=K[part])
            K[part] *= sf2
        # at repeated inputs the arcsine has a cusp: its slope is set to 0
        D[D == 0.0] = np.inf
        return K, lambda W: self._contract(W, sf2, rows, others)

    def _fill_squares(self, theta: Array) -> None:
        """Write D^2 into the memory of D."""
        inverse = 2.0 * np.exp(-2.0 * theta[1:-1])
        of_pairs = [inverse[a] * inverse[b] for a, b in self._pairs]
        weights = np.concatenate([np.exp(theta[-1]) * inverse, of_pairs])
        flat = self._squares.reshape(self._squares.shape[0], -1)
        np.matmul(weights, flat, out=self._D.reshape(-1))

    def _contract(
        self, W: Array, sf2: float, rows: Augmented, others: Augmented
    ) -> Array:
        """Return sum_ij W_ij dK_ij/dtheta.

        For any parameter t, dk/dt = sf^2 [dN/dt - N/2 (dA/dt / A + dA'/dt / A')] / D.
        So only W/D, W N/D and their products with U and 1/A are needed.
        """
        of_sf = 2.0 * float(np.vdot(W, self._K))
        q = np.divide(W, self._D, out=W)
        r = np.multiply(q, self._N, out=self._N)
        of_shape = 2.0 * np.einsum("na,na->a", rows.U, q @ others.U)
        of_shape -= (rows.U**2).T @ (r.sum(axis=1) / rows.A)
        of_shape -= (others.U**2).T @ (r.sum(axis=0) / others.A)
        return _slopes(of_sf, sf2 * of_shape)


def _slopes(of_sf: float, of_shape: Array) -> Array:
    """Convert slopes in log U_0^2 = log beta and log U_d^2 to slopes in theta.

    U_d^2 ~ l_d^-2, and a sum over U_a is twice the slope in log U_a^2.
    """
    return np.concatenate([[of_sf], -of_shape[1:], [0.5 * of_shape[0]]])
