"""Gaussian process regression: marginal likelihood, its optimum, prediction.

Equations 6 and 7 of the traction paper; the likelihood and its gradient come from one
Cholesky factorisation (Rasmussen and Williams, 2006, eqs. 2.30 and 5.9).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs, solve_triangular
from scipy.optimize import minimize

from acquisition.errors import SettingsError
from analysis.kernels import Kernel, SquaredExponential
from analysis.noise import ConstantNoise, Noise
from analysis.series import Array

MINIMUM_ROWS = 20

_potrf, _potrs, _potri = get_lapack_funcs(("potrf", "potrs", "potri"), dtype=float)
_STARTS = ((1.0, 0.5), (3.0, 0.9), (1.0 / 3.0, 0.3))  # (l / sd(x), sn / sd(y))
_JITTERS = (0.0, 1e-10, 1e-8, 1e-6)  # times the mean variance; the first that works
_HOPELESS = 1e25  # objective where no jitter helps
_BLOCK = 2000  # columns predicted at a time
_AT_BOUND = 1e-3


class Factor(NamedTuple):
    """The covariance C = K + S, factorised.

    Attributes:
        L: lower Cholesky factor in the lower triangle; above it is not cleared.
        jitter: what had to be added to the diagonal [N^2], mostly 0.
    """

    L: Array
    jitter: float


class Start(NamedTuple):
    """One start of the search and what it reached."""

    theta: tuple[float, ...]
    lml: float


class Optimum(NamedTuple):
    """The best hyperparameters found and every start's result."""

    theta: Array
    lml: float
    starts: tuple[Start, ...]
    at_bound: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class GaussianProcess:
    """A fitted Gaussian process on standardised inputs.

    Attributes:
        kernel: covariance function.
        noise: noise of the measurements.
        theta: logarithms of the kernel's, then the noise's hyperparameters.
        X: standardised training inputs, shape (n, d).
        alpha: C^-1 (y - offset), shape (n,).
        offset: mean of the training outputs.
        centre: mean of the training inputs, shape (d,).
        scale: standard deviation of the training inputs, shape (d,); 1 if constant.
        lml: log marginal likelihood of the training outputs.
        starts: where every start of the search ended.
        jitter: what the factorisation needed on the diagonal.
        at_bound: hyperparameters at the edge of the search.
    """

    kernel: Kernel
    noise: Noise
    theta: Array
    X: Array
    alpha: Array
    offset: float
    centre: Array
    scale: Array
    lml: float
    starts: tuple[Start, ...]
    jitter: float
    at_bound: tuple[str, ...]

    def mean(self, inputs: Array) -> Array:
        """Return the predictive mean at `inputs`, shape (m, d), in y's unit."""
        theta, _ = _split(self.kernel, self.theta)
        Z = (inputs - self.centre) / self.scale
        blocks = [
            self.kernel.matrix(theta, Z[i : i + _BLOCK], self.X) @ self.alpha
            for i in range(0, Z.shape[0], _BLOCK)
        ]
        return self.offset + np.concatenate([np.zeros(0), *blocks])

    def predict(
        self, inputs: Array, *, include_noise: bool = True
    ) -> tuple[Array, Array]:
        """Return the predictive mean and variance at `inputs`, shape (m, d).

        Args:
            inputs: rows in the units of the training inputs.
            include_noise: variance of a measurement; False gives eq. (7), that of the
                function itself.

        Returns:
            Mean and variance, each of shape (m,).
        """
        theta, theta_noise = _split(self.kernel, self.theta)
        Z = (inputs - self.centre) / self.scale
        S = self.noise.variance(theta_noise, self.X)
        L = factorise(self.kernel.matrix(theta, self.X, self.X), S).L
        variance = self.kernel.diagonal(theta, Z)
        for i in range(0, Z.shape[0], _BLOCK):
            cross = self.kernel.matrix(theta, self.X, Z[i : i + _BLOCK])
            half = solve_triangular(L, cross, lower=True, check_finite=False)
            variance[i : i + _BLOCK] -= np.einsum("nm,nm->m", half, half)
        variance = np.maximum(variance, 0.0)
        if include_noise:
            variance = variance + self.noise.variance(theta_noise, Z)
        return self.mean(inputs), variance


def factorise(K: Array, S: Array) -> Factor:
    """Return the Cholesky factor of K + diag(S), with jitter only if it needs some.

    Raises:
        SettingsError: not positive definite with the largest jitter either.
    """
    for share in _JITTERS:
        C = K.copy()
        jitter = share * float(np.mean(np.diagonal(K)))
        C.flat[:: C.shape[0] + 1] += S + jitter
        # the transpose of a symmetric matrix is itself, in the order LAPACK likes
        L, info = _potrf(C.T, lower=1, clean=0, overwrite_a=1)
        if info == 0:
            return Factor(L, jitter)
    raise SettingsError(
        f"The covariance of {K.shape[0]} samples is not positive definite.",
        hint="Check the samples for enormous values.",
    )


def likelihood(
    model: tuple[Kernel, Noise], theta: Array, X: Array, r: Array
) -> tuple[float, Array]:
    """Return the log marginal likelihood of r and its gradient in theta.

    Args:
        model: kernel and noise.
        theta: the kernel's, then the noise's hyperparameters.
        X: inputs, shape (n, d).
        r: outputs with the mean function taken off, shape (n,).

    Raises:
        SettingsError: the covariance cannot be factorised.
    """
    kernel, noise = model
    theta_kernel, theta_noise = _split(kernel, theta)
    K, contract = kernel.evaluate(theta_kernel, X)
    S, contract_noise = noise.evaluate(theta_noise, X)
    L = factorise(K, S).L
    alpha = _potrs(L, r, lower=1)[0]
    half_log_det = float(np.sum(np.log(np.diagonal(L))))
    lml = -0.5 * float(r @ alpha) - half_log_det - 0.5 * r.size * np.log(2.0 * np.pi)
    inverse = _symmetric(_potri(L, lower=1, overwrite_c=1)[0])
    slope = contract(np.outer(alpha, alpha) - inverse)
    slope_noise = contract_noise(alpha * alpha - np.diagonal(inverse))
    return lml, np.concatenate([slope, slope_noise])


def maximise(model: tuple[Kernel, Noise], X: Array, r: Array) -> Optimum:
    """Return the hyperparameters of largest likelihood from three starts."""
    kernel, noise = model
    sd_y, sd_x = float(np.std(r)), _spread(X)
    bounds = np.vstack([kernel.bounds(sd_y, sd_x), noise.bounds(sd_y)])
    reached = [
        _climb(
            model,
            (X, r),
            np.concatenate(
                [kernel.start(sd_y, sd_x, stretch), noise.start(sd_y, share)]
            ),
            bounds,
        )
        for stretch, share in _STARTS
    ]
    best = max(reached, key=lambda start: start.lml)
    theta = np.array(best.theta)
    is_edge = np.abs(bounds - theta[:, None]).min(axis=1) < _AT_BOUND
    names = np.array([*kernel.names, *noise.names])
    return Optimum(theta, best.lml, tuple(reached), tuple(map(str, names[is_edge])))


def fit_gp(
    inputs: Array,
    y: Array,
    kernel: Kernel | None = None,
    noise: Noise | None = None,
) -> GaussianProcess:
    """Return a Gaussian process fitted to `y` with its own mean taken off.

    Args:
        inputs: training inputs, shape (n, d); standardised here.
        y: training outputs, shape (n,).
        kernel: covariance function, by default squared exponential.
        noise: noise of the measurements, by default constant.

    Raises:
        SettingsError: fewer than 20 rows, or outputs that do not vary.
    """
    if y.size < MINIMUM_ROWS or np.ptp(y) == 0:
        raise SettingsError(
            f"No Gaussian process from {y.size} samples spanning {_span(y):.3g} N "
            f"(at least {MINIMUM_ROWS} that differ).",
            hint="Record more motion inside the window of velocities.",
        )
    kernel = kernel or SquaredExponential(inputs.shape[1])
    noise = noise or ConstantNoise()
    centre, scale = inputs.mean(axis=0), _spread(inputs)
    X, offset = (inputs - centre) / scale, float(y.mean())
    optimum = maximise((kernel, noise), X, y - offset)
    theta_kernel, theta_noise = _split(kernel, optimum.theta)
    K = kernel.matrix(theta_kernel, X, X)
    factor = factorise(K, noise.variance(theta_noise, X))
    return GaussianProcess(
        kernel=kernel,
        noise=noise,
        theta=optimum.theta,
        X=X,
        alpha=_potrs(factor.L, y - offset, lower=1)[0],
        offset=offset,
        centre=centre,
        scale=scale,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=factor.jitter,
        at_bound=optimum.at_bound,
    )


def _climb(
    model: tuple[Kernel, Noise], data: tuple[Array, Array], start: Array, bounds: Array
) -> Start:
    def objective(theta: Array) -> tuple[float, Array]:
        try:
            lml, slope = likelihood(model, theta, *data)
        except SettingsError:
            return _HOPELESS, np.zeros_like(theta)
        return -lml, -slope

    found = minimize(
        objective,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": 200, "gtol": 1e-5, "ftol": 2e-9},
    )
    return Start(tuple(float(value) for value in found.x), -float(found.fun))


def _split(kernel: Kernel, theta: Array) -> tuple[Array, Array]:
    count = len(kernel.names)
    return theta[:count], theta[count:]


def _symmetric(lower: Array) -> Array:
    """Return the full matrix of which only the lower triangle is valid."""
    full = np.tril(lower)
    full += np.tril(lower, -1).T
    return full


def _spread(X: Array) -> Array:
    """Return the standard deviation of every column, 1 where it does not vary."""
    sd = X.std(axis=0)
    return np.where(np.ptp(X, axis=0) > 0, sd, 1.0)


def _span(y: Array) -> float:
    return float(np.ptp(y)) if y.size else 0.0
