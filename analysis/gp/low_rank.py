"""The likelihood from a few pivots: what a search climbs until it is near a top.

The kernel's part of the covariance is that of its values at m pivots among the rows
(Nystroem), and what rows of a trial share is as many columns as there are trials:

    C ~ S + V'V + Phi'Phi,   V = L^-1 k(P, X),   L L' = k(P, P)

With U = [V; Phi] S^-1/2, B = I + U U' and b = B^-1 U S^-1/2 r, Woodbury's identity and
the determinant lemma give likelihood and gradient in O(n m^2):

    log det C = log det S + log det B,   U C^-1 U' = I - B^-1,   U C^-1 r = b

With a = C^-1 r, W = a a' - C^-1, F = k(P, X), A = k(P, P) and M = A^-1 F, the gradient
1/2 tr(W dC) is sum (M W) o dF - 1/2 sum (M W M') o dA in the kernel. For the noise it
takes the diagonal of W, which follows from that of C W = r a' - I.

The pivots are those of a Cholesky factorisation of S^-1/2 K S^-1/2 (Harbrecht, Peters
and Schneider 2012). What it leaves, R = K - V'V, has no negative eigenvalue, so its
scaled trace t = sum_i R_ii / S_ii bounds the error: log det C is too small by t at
most, r'C^-1 r too large by at most t times its value.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array, Indices
from analysis.gp.kernels import Contraction, Kernel
from analysis.gp.likelihood import Likelihood, lapack, split
from analysis.gp.noise import Noise
from analysis.gp.trial_noise import ColumnsAt, columns_over

_FEWEST = 40  # pivots: they have to serve where lengths are shorter, too
_MOST = 80  # pivots beyond which an evaluation costs half of an exact one
_LEAST = 1e-3  # t at which there is nothing left to choose pivots from
_JITTER = 1e-9  # of the pivots' variances

Columns = Callable[[Array], ColumnsAt]


class _Whitened(NamedTuple):
    """What value and gradient share at one theta.

    Attributes:
        lml: log marginal likelihood.
        F: k(P, X), shape (m, n).
        root: S^-1/2, shape (n,).
        L_inverse: shape (m, m).
        U: U, and S^-1/2 r as one more row.
        B_factor: inverse Cholesky factor of B, with that row too.
        contract: the kernel's contraction.
        noise: S, shape (n,), and its contraction.
        columns: what rows of one trial share.
    """

    lml: float
    F: Array
    root: Array
    L_inverse: Array
    U: Array
    B_factor: Array
    contract: Contraction
    noise: tuple[Array, Contraction]
    columns: ColumnsAt


class LowRankLikelihood:
    """The likelihood of outputs by the kernel's values at pivots, for any theta.

    Args:
        model: kernel and noise; theta is the kernel's, then the noise's.
        X: inputs, shape (n, d).
        r: outputs with the mean function taken off, shape (n,).
        pivots: places of m rows.
        columns: what gives, for any theta, what rows of one trial share.
    """

    def __init__(
        self,
        model: tuple[Kernel, Noise],
        X: Array,
        r: Array,
        pivots: Indices,
        columns: Columns,
    ) -> None:
        self._kernel, self._noise = model
        self._X, self._r, self._pivots = X, r, pivots
        self._columns = columns
        self._cross = self._kernel.over(X[pivots], X)
        self._last: tuple[bytes, _Whitened] | None = None
        self._constant = -0.5 * r.size * np.log(2.0 * np.pi)

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the likelihood and its gradient in theta.

        Raises:
            SettingsError: the pivots' covariance cannot be factorised.
        """
        at = self._at(theta)
        S, contract_noise = at.noise
        weight, on_diagonal, inner = self._weights(at)
        slope_noise = contract_noise(on_diagonal / S)
        m = self._pivots.size
        slope_noise += at.columns.contract(np.diagonal(inner)[m:] - 1.0)
        return at.lml, np.concatenate([at.contract(weight), slope_noise])

    def value(self, theta: Array) -> tuple[float, float]:
        """Return the likelihood alone, and t there.

        Raises:
            SettingsError: the pivots' covariance cannot be factorised.
        """
        if self._last and self._last[0] == theta.tobytes():
            at = self._last[1]
        else:
            at = self._at(theta)
        variances = self._kernel.diagonal(split(self._kernel, theta)[0], self._X)
        seen = at.U[: self._pivots.size].ravel()
        return at.lml, float(variances @ (at.root * at.root) - seen @ seen)

    def _at(self, theta: Array) -> _Whitened:
        theta_kernel, theta_noise = split(self._kernel, theta)
        F, contract = self._cross(theta_kernel)
        noise = self._noise.evaluate(theta_noise, self._X)
        columns = self._columns(theta_noise)
        root, m = 1.0 / np.sqrt(noise[0]), self._pivots.size
        A = F[:, self._pivots]
        A.flat[:: m + 1] *= 1.0 + _JITTER
        L_inverse = _inverse_factor(A)

        U = np.empty((m + len(columns.Phi) + 1, self._r.size))
        np.multiply(F, root, out=U[:m])
        lapack("trmm")(
            1.0, L_inverse, U[:m].T, side=1, lower=1, trans_a=1, overwrite_b=1
        )
        np.multiply(columns.Phi, root, out=U[m:-1])
        # as one more row the outputs leave r'C^-1 r as the square of the last pivot
        np.multiply(self._r, root, out=U[-1])
        B = U @ U.T
        B.flat[: -1 : len(B) + 1] += 1.0
        B_factor = _inverse_factor(B)
        rest = 1.0 / float(B_factor[-1, -1])
        half_log_det = -np.log(np.diagonal(B_factor)[:-1]).sum() - np.log(root).sum()
        lml = float(self._constant - half_log_det - 0.5 * rest * rest)
        at = _Whitened(lml, F, root, L_inverse, U, B_factor, contract, noise, columns)
        self._last = theta.tobytes(), at
        return at

    def _weights(self, at: _Whitened) -> tuple[Array, Array, Array]:
        """Return what derivatives are contracted with.

        Returns:
            What dF is contracted with, that of dA taken in at the pivots' columns,
            shape (m, n); the diagonal of S W, shape (n,); and b b' + B^-1.
        """
        F, root, L_inverse, U, B_factor = at[1:6]
        m = len(F)
        b, half = B_factor[-1, :-1] / -B_factor[-1, -1], B_factor[:-1, :-1]
        inner = half.T @ half
        inner += b * b[:, None]
        of_U = np.empty((len(b), len(b) + 1))  # U W S^1/2 = of_U U
        np.negative(inner, out=of_U[:, :-1])
        of_U[:, -1] = b
        of_F = L_inverse.T @ of_U[:m]
        of_pivots = (of_F[:, :m] + L_inverse.T) @ L_inverse
        of_pivots.flat[:: m + 1] *= 1.0 + _JITTER
        weight = of_F @ U
        weight *= root
        on_diagonal = U[-1] * (U[-1] - b @ U[:-1]) - 1.0
        on_diagonal -= np.einsum("mn,mn->n", F, weight)
        if len(b) > m:
            on_diagonal -= np.einsum("qn,qn->n", U[m:-1], of_U[m:] @ U)
        weight[:, self._pivots] += 0.5 * of_pivots
        return weight, on_diagonal, inner


def choose_pivots(K: Array, S: Array, trace: tuple[float, float]) -> Indices | None:
    """Return the rows that serve as pivots; None where it takes too many.

    Args:
        K: covariances of all rows, shape (n, n); only the upper triangle is read, and
            all is overwritten.
        S: variances of the noise, shape (n,).
        trace: t that pivots are chosen for, and that they may leave where there are
            never enough.
    """
    root = 1.0 / np.sqrt(S)
    K *= root
    K *= root[:, None]
    total, n = float(np.trace(K)), root.size
    # the upper triangle in C's order is the lower one in Fortran's
    L, order, rank, _ = lapack("pstrf")(K.T, tol=_LEAST / n, lower=1, overwrite_a=1)
    if not rank:  # no function at all
        return None
    most = min(rank, _MOST)
    head, rest = np.tril(L[:most, :most]), L[most:, :most]
    seen = np.einsum("nm,nm->m", head, head) + np.einsum("nm,nm->m", rest, rest)
    tail = total - np.cumsum(seen)
    needed = 1 + int(np.count_nonzero(tail > trace[0]))
    count = min(max(needed, _FEWEST), _MOST, n // 3, rank)
    return order[:count] - 1 if tail[count - 1] < trace[1] else None


def _inverse_factor(A: Array) -> Array:
    """Return L^-1 of A = L L', lower; A is overwritten.

    Raises:
        SettingsError: A is not positive definite.
    """
    L, info = lapack("potrf")(A.T, lower=1, clean=1, overwrite_a=1)
    if info:
        raise SettingsError("The covariance of the pivots is not positive definite.")
    return lapack("trtri")(L, lower=1, overwrite_c=1)[0]


# theta, t -> an approximation that is good around it; None where there is none
Near = Callable[[Array, tuple[float, float]], LowRankLikelihood | None]


def near_over(likelihood: Likelihood) -> Near:
    """Return what gives the low-rank likelihood around any theta.

    There is none where it would take too many pivots, or a residual drifts along the
    trials: that has no few columns.
    """
    model, X, r = likelihood.model, likelihood.X, likelihood.r
    columns = columns_over(model[1], X, likelihood.trials)
    if columns is None:
        return lambda theta, trace: None

    kernel, noise = model

    @cache
    def made(
        place: tuple[float, ...], trace: tuple[float, float]
    ) -> LowRankLikelihood | None:
        theta_kernel, theta_noise = split(kernel, np.array(place))
        S, _ = noise.evaluate(theta_noise, X)
        pivots = choose_pivots(likelihood.covariance(theta_kernel)[0], S, trace)
        if pivots is None:
            return None
        return LowRankLikelihood(model, X, r, pivots, columns)

    return lambda theta, trace: made(tuple(theta.tolist()), trace)
