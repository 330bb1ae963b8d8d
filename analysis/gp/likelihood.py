"""Log marginal likelihood of a Gaussian process and its gradient.

Value and gradient come from one Cholesky factorisation (Rasmussen and Williams, 2006,
eqs. 2.30 and 5.9). For a few hundred rows most of the time goes into the inverse, and
as much again into fresh memory: so the memory is kept, and the inverse is put together
from products of triangular blocks, which run several times faster than LAPACK's own.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

# here, not where it is first called: a limit of threads reaches only libraries that
# are loaded, and on busy cores several threads for small matrices wait for each other
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.kernels import Contraction, Kernel
from analysis.gp.noise import Noise
from analysis.gp.trial_noise import SharedAt, TrialRows, shared_over

_JITTERS = (0.0, 1e-10, 1e-8, 1e-6)  # times the mean variance; the first that suffices
_BLAS = frozenset({"syr", "trmm", "trsm"})
_SMALL = 40  # rows below which LAPACK inverts a triangle as fast as the block recursion


class Factor(NamedTuple):
    """Cholesky factor of the covariance C = K + S.

    Attributes:
        L: lower Cholesky factor, zero above the diagonal.
        jitter: added to the diagonal [N^2], mostly 0.
    """

    L: Array
    jitter: float

    def solve(self, r: Array) -> Array:
        """Return C^-1 r, shape (n,)."""
        return lapack("potrs")(self.L, r, lower=1)[0]

    def half(self, r: Array) -> Array:
        """Return L^-1 r, shape (n, m) as r.

        Solved as r' = x' L', so that a C-ordered r needs no copy.
        """
        return lapack("trsm")(1.0, self.L, r.T, side=1, lower=1, trans_a=1).T

    def inverse(self) -> Array:
        """Return C^-1, shape (n, n)."""
        lower, _ = lapack("potri")(self.L, lower=1)
        return lower + np.tril(lower, -1).T


def factorise(
    K: Array,
    S: Array,
    memory: Array | None = None,
    blocks: Sequence[tuple[slice, Array]] = (),
) -> Factor:
    """Factorise K + diag(S), with the smallest jitter that suffices.

    Args:
        K: covariances, shape (n, n); only the upper triangle is read.
        S: added to the diagonal, shape (n,).
        blocks: added to diagonal blocks, as (rows, covariances).
        memory: output array of the factor, shape (n, n) in Fortran order; allocated by
            default.

    Raises:
        SettingsError: not positive definite even with the largest jitter.
    """
    C = np.empty(K.shape, order="F") if memory is None else memory
    for share in _JITTERS:
        jitter = share and share * float(np.mean(np.diagonal(K)))
        # the upper triangle in C order is the lower one in Fortran order
        np.copyto(C, K.T)
        C.T.flat[:: S.size + 1] += S + jitter
        for rows, block in blocks:
            C[rows, rows] += block
        L, info = lapack("potrf")(C, lower=1, clean=1, overwrite_a=1)
        if info == 0:
            return Factor(L, jitter)
    raise SettingsError(
        f"The covariance of {K.shape[0]} samples is not positive definite.",
        hint="Check the samples for enormous values.",
    )


class _Evaluation(NamedTuple):
    """Quantities shared by the likelihood and its gradient at one theta.

    Attributes:
        lml: log marginal likelihood.
        factor: Cholesky factor of the covariance.
        alpha: C^-1 r, shape (n,).
        contract: contraction of the kernel.
        contract_noise: contraction of the noise; takes the diagonal of the weight.
        shared: covariances within trials, and their contraction.
    """

    lml: float
    factor: Factor
    alpha: Array
    contract: Contraction
    contract_noise: Contraction
    shared: SharedAt


class Likelihood:
    """Log marginal likelihood of outputs as a function of theta.

    Args:
        kernel: covariance function.
        noise: measurement noise; theta holds the kernel's, then the noise's parameters.
        X: inputs, shape (n, d).
        r: outputs minus the mean function, shape (n,).
        trials: trial of every row; None if rows share nothing but the kernel.
    """

    def __init__(
        self,
        kernel: Kernel,
        noise: Noise,
        X: Array,
        r: Array,
        trials: TrialRows | None = None,
    ) -> None:
        self.kernel, self.noise = kernel, noise
        self.X, self.r, self.trials = X, r, trials
        self._covariance = kernel.over(X)
        self._shared = shared_over(noise, trials)
        shape = (r.size, r.size)
        self._C, self._inverse = (np.zeros(shape, order="F") for _ in range(2))
        self._last: tuple[bytes, Array, float] = b"", r, 0.0

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the likelihood and its gradient in theta.

        The gradient is 1/2 sum_ij (alpha alpha' - C^-1)_ij dC_ij. The weight is
        symmetric, so the kernel gets its lower triangle with half of the diagonal.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        at = self._evaluate(theta)
        minus = self._minus_weight(at.factor.L, at.alpha)
        on_diagonal = -np.diagonal(minus)
        minus.T.flat[:: at.alpha.size + 1] *= 0.5
        slope_noise = at.contract_noise(on_diagonal)
        if at.shared.blocks:
            slope_noise -= at.shared.contract(minus)
        # the transpose has K's memory order and its valid (upper) triangle
        slope = -at.contract(minus.T)
        return at.lml, np.concatenate([slope, slope_noise])

    def value(self, theta: Array) -> float:
        """Return the likelihood without its gradient, at a third of the cost.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        return self._evaluate(theta).lml

    def weights(self, theta: Array) -> tuple[Array, float]:
        """Return C^-1 r, shape (n,), and the jitter added to C.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        if self._last[0] != theta.tobytes():
            self._evaluate(theta)
        return self._last[1:]

    def thinned(self, most: int) -> "Likelihood":
        """Return the likelihood of evenly thinned rows, at most `most` of them."""
        thin = slice(None, None, -(-self.r.size // most))
        trials = None if self.trials is None else self.trials.take(thin)
        return Likelihood(self.kernel, self.noise, self.X[thin], self.r[thin], trials)

    def _evaluate(self, theta: Array) -> "_Evaluation":
        theta_kernel, theta_noise = split(self.kernel, theta)
        K, contract = self._covariance(theta_kernel)
        S, contract_noise = self.noise.evaluate(theta_noise, self.X)
        shared = self._shared(theta_noise)
        factor = factorise(K, S, self._C, shared.blocks)
        alpha = factor.solve(self.r)
        lml = -0.5 * float(self.r @ alpha) - 0.5 * alpha.size * np.log(2.0 * np.pi)
        lml -= float(np.sum(np.log(np.diagonal(factor.L))))
        self._last = theta.tobytes(), alpha, factor.jitter
        return _Evaluation(lml, factor, alpha, contract, contract_noise, shared)

    def _minus_weight(self, L: Array, alpha: Array) -> Array:
        """Return the lower triangle of C^-1 - alpha alpha', zero above."""
        _invert(L, self._inverse, 0, alpha.size)
        inverse, _ = lapack("lauum")(self._inverse, lower=1, overwrite_c=1)
        return lapack("syr")(-1.0, alpha, lower=1, a=inverse, overwrite_a=1)


def split(kernel: Kernel, theta: Array) -> tuple[Array, Array]:
    """Split theta into the parts of the kernel and of the noise."""
    count = len(kernel.names)
    return theta[:count], theta[count:]


def _invert(L: Array, inverse: Array, low: int, high: int) -> None:
    """Write the inverse of a diagonal block of L, rows `low` to `high`, to `inverse`.

    Recursive: [[A, 0], [B, D]]^-1 = [[A^-1, 0], [-D^-1 B A^-1, D^-1]].
    """
    if high - low <= _SMALL:
        block = slice(low, high)
        inverse[block, block] = lapack("trtri")(L[block, block], lower=1)[0]
        return
    middle = (low + high) // 2
    upper, lower = slice(low, middle), slice(middle, high)
    _invert(L, inverse, low, middle)
    _invert(L, inverse, middle, high)
    times = lapack("trmm")
    right = times(-1.0, inverse[lower, lower], L[lower, upper], lower=1)
    inverse[lower, upper] = times(
        1.0, inverse[upper, upper], right, side=1, lower=1, overwrite_b=1
    )


@lru_cache
def lapack(name: str) -> Callable[..., Any]:
    """Return a double-precision LAPACK or BLAS routine by name without prefix."""
    get: Any = get_blas_funcs if name in _BLAS else get_lapack_funcs
    return get(name, dtype=float)
