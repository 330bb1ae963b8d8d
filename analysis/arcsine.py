"""The arcsine covariance of an infinite neural network (eq. 5).

p(x) = beta + 2 sum_d x_d^2/l_d^2,  N(x, x') = beta + 2 sum_d x_d x'_d/l_d^2
k(x, x') = sf^2 asin(N / sqrt((c + p(x)) (c + p(x'))))

c = 1 is the covariance of a network (Rasmussen and Williams 2006, eq. 4.29, with
beta = 2 sigma_0^2 and their 2/pi inside sf). c = 0 is eq. (5) as printed: there k(x, x)
is the same everywhere and the arcsine has a cusp at zero distance, so functions are
very rough.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.kernels import Composable, Contraction
from analysis.series import Array

_ROOT_2 = np.sqrt(2.0)
_BIAS_EXPONENT = -np.log(20.0) / np.log(3.0)  # beta 1/20 for 3 lengths, 20 for 1/3


class _Rows(NamedTuple):
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
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters."""
        lengths = (f"log_l{d + 1}" for d in range(self.dimensions))
        return ("log_sf", *lengths, "log_beta")

    @property
    def c(self) -> float:
        """What is added to both factors under the root [-]."""
        return 0.0 if self.as_printed else 1.0

    def matrix(self, theta: Array, X: Array, X_other: Array) -> Array:
        """Return the covariances of two sets of rows, shape (n, m)."""
        rows, others = self._rows(theta, X), self._rows(theta, X_other)
        return self._angles(rows, others)[0] * np.exp(2.0 * theta[0])

    def diagonal(self, theta: Array, X: Array) -> Array:
        """Return sf^2 asin(p/(c + p)) of every row."""
        A = self._rows(theta, X).A
        return np.exp(2.0 * theta[0]) * np.arctan2(
            A - self.c, np.sqrt(self.c * (2.0 * A - self.c))
        )

    def evaluate(
        self, theta: Array, X: Array, X_other: Array
    ) -> tuple[Array, Contraction]:
        """Return K and its contraction.

        With D = sqrt(A A' - N^2), the sine's partner, and any parameter t,
        dk/dt = sf^2 [dN/dt - N/2 (dA/dt / A + dA'/dt / A')] / D. So W o sf^2/D and that
        times N are all that is needed, and their products with U and 1/A.
        """
        rows, others = self._rows(theta, X), self._rows(theta, X_other)
        angle, N, D = self._angles(rows, others)
        sf2 = np.exp(2.0 * theta[0])
        K = sf2 * angle
        # at repeated inputs with c = 0 the arcsine has its cusp: D = 0, slope set to 0
        weight = np.divide(sf2, D, out=np.zeros_like(D), where=D > 0)

        def contract(W: Array) -> Array:
            q = W * weight
            r = q * N
            of_shape = 2.0 * np.einsum("na,na->a", rows.U, q @ others.U)
            of_shape -= (rows.U**2).T @ (r.sum(axis=1) / rows.A)
            of_shape -= (others.U**2).T @ (r.sum(axis=0) / others.A)
            # U_0^2 = beta and U_d^2 ~ l_d^-2: slopes of log beta and of -2 log l_d
            of_sf = 2.0 * np.vdot(W, K)
            return np.concatenate([[of_sf], -of_shape[1:], [0.5 * of_shape[0]]])

        return K, contract

    def diagonal_slope(self, theta: Array, X: Array, w: Array) -> Array:
        """Return sum_i w_i dk(x_i, x_i)/dtheta, shape (p,)."""
        U, A = self._rows(theta, X)
        of_sf = 2.0 * float(w @ self.diagonal(theta, X))
        # d asin(p/A)/dp = c / (A sqrt(A^2 - p^2))
        root = np.sqrt(self.c * (2.0 * A - self.c))
        share = np.divide(self.c, A * root, out=np.zeros_like(A), where=root > 0)
        of_shape = np.exp(2.0 * theta[0]) * ((U**2).T @ (w * share))
        return np.concatenate([[of_sf], -2.0 * of_shape[1:], [of_shape[0]]])

    def start(self, sd_y: float, sd_x: Array, stretch: float) -> Array:
        """Return sf = sd(y), l_d = stretch sd(x_d), beta = 1/20, 1, 20 for 3, 1, 1/3.

        Long lengths with next to no bias, and short ones with a large bias, are optima
        of their own, which no start with beta = 1 finds.
        """
        beta = stretch**_BIAS_EXPONENT
        return np.log(np.concatenate([[sd_y], stretch * sd_x, [beta]]))

    def bounds(self, sd_y: float, sd_x: Array) -> Array:
        """Return log sf in log sd(y) + [-6, 4], log l_d in [-4, 6], log beta +-6."""
        centre = np.log(np.concatenate([[sd_y], sd_x, [1.0]]))
        span = [[-6.0, 4.0], *([[-4.0, 6.0]] * self.dimensions), [-6.0, 6.0]]
        return centre[:, None] + np.array(span)

    def _rows(self, theta: Array, X: Array) -> _Rows:
        bias = np.full(X.shape[0], np.exp(0.5 * theta[-1]))
        U = np.column_stack([bias, _ROOT_2 * X / np.exp(theta[1:-1])])
        return _Rows(U, self.c + np.einsum("na,na->n", U, U))

    def _angles(self, rows: _Rows, others: _Rows) -> tuple[Array, Array, Array]:
        """Return asin(u), N and D = sqrt(A A' - N^2), each of shape (n, m).

        D by Lagrange's identity, A A' - N^2 = c (c + p + p') + sum_{a<b} (U_a U'_b -
        U_b U'_a)^2, which cancels nothing where u is close to one; then asin(u) =
        atan2(N, D).
        """
        N = rows.U @ others.U.T
        D2 = self._squares(rows, others)
        np.sqrt(D2, out=D2)
        return np.arctan2(N, D2), N, D2

    def _squares(self, rows: _Rows, others: _Rows) -> Array:
        c = self.c
        D2 = np.add.outer(c * (rows.A - 0.5 * c), c * (others.A - 0.5 * c))
        columns = rows.U.shape[1]
        for a in range(columns):
            for b in range(a + 1, columns):
                wedge = np.multiply.outer(rows.U[:, a], others.U[:, b])
                wedge -= np.multiply.outer(rows.U[:, b], others.U[:, a])
                wedge *= wedge
                D2 += wedge
        return D2
