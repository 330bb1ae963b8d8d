"""A Gaussian process of all samples through a few inducing points.

Variational free energy (Titsias 2009): the covariance is replaced by its projection on
m inducing points, Q = K_fu K_uu^-1 K_uf, and the bound

    log N(r; 0, Q + S) - 1/2 sum_i (k_ii - Q_ii) / S_ii  <=  log marginal likelihood

is maximised. Cost n m^2 instead of n^3. Samples of a trial are strongly correlated, so
thousands of rows make the process surer of its mean than it has a right to be.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.gp import check_outputs, factorise, split
from analysis.kernels import Kernel, SquaredExponential
from analysis.noise import ConstantNoise, Noise
from analysis.search import Start, maximise, spread
from analysis.series import Array, Indices

INDUCING = 32
JITTER = 1e-8  # on K_uu, times its mean variance

_LENGTH = 0.5  # of the kernel that chooses inducing points, in standard deviations


@dataclass(frozen=True, slots=True)
class SparseProcess:
    """A fitted Gaussian process that remembers its inducing points only.

    Attributes:
        kernel: covariance function.
        noise: noise of the measurements.
        theta: logarithms of the kernel's, then the noise's hyperparameters.
        X: standardised inducing inputs, shape (m, d).
        alpha: weights of the inducing points in the mean, shape (m,).
        root: R with R R' = K_uu^-1 - (K_uu + K_uf S^-1 K_fu)^-1, shape (m, m).
        offset: what was taken off the training outputs.
        centre: mean of the training inputs, shape (d,).
        scale: standard deviation of the training inputs, shape (d,).
        lml: the bound on the log marginal likelihood, noise prior included.
        starts: where every start of the search ended.
        jitter: what was added to the diagonal of K_uu.
        at_bound: hyperparameters at the edge of the search.
    """

    kernel: Kernel
    noise: Noise
    theta: Array
    X: Array
    alpha: Array
    root: Array
    offset: float
    centre: Array
    scale: Array
    lml: float
    starts: tuple[Start, ...]
    jitter: float
    at_bound: tuple[str, ...]

    def mean(self, inputs: Array) -> Array:
        """Return the predictive mean at `inputs`, shape (m, d), in y's unit."""
        theta, _ = split(self.kernel, self.theta)
        Z = (inputs - self.centre) / self.scale
        return self.offset + self.kernel.matrix(theta, Z, self.X) @ self.alpha

    def predict(
        self, inputs: Array, *, include_noise: bool = True
    ) -> tuple[Array, Array]:
        """Return the predictive mean and variance at `inputs`, shape (m, d).

        Args:
            inputs: rows in the units of the training inputs.
            include_noise: variance of a measurement; False gives the function's own.

        Returns:
            Mean and variance, each of shape (m,).
        """
        theta, theta_noise = split(self.kernel, self.theta)
        Z = (inputs - self.centre) / self.scale
        cross = self.kernel.matrix(theta, Z, self.X)
        known = cross @ self.root
        variance = self.kernel.diagonal(theta, Z) - np.einsum("nm,nm->n", known, known)
        variance = np.maximum(variance, 0.0)
        if include_noise:
            variance = variance + self.noise.variance(theta_noise, Z)
        return self.offset + cross @ self.alpha, variance


class _Projection(NamedTuple):
    """The parts of a bound that its value, slope and prediction share.

    Attributes:
        L_u: Cholesky factor of K_uu, (m, m).
        A: L_u^-1 K_uf S^-1/2, (m, n).
        L_b: Cholesky factor of B = I + A A', (m, m).
        a: (Q + S)^-1 r, (n,).
        quadratic: r' a.
    """

    L_u: Array
    A: Array
    L_b: Array
    a: Array
    quadratic: float


def choose_inducing(X: Array, count: int) -> Indices:
    """Return the rows of X (n, d) that explain the others best, one after the other.

    Greedy pivoted Cholesky of a squared exponential of length 0.5 sd; fewer than
    `count` where nothing is left to explain.
    """
    kernel, theta = SquaredExponential(X.shape[1]), np.zeros(1 + X.shape[1])
    theta[1:] = np.log(_LENGTH)
    left = np.ones(X.shape[0])
    factor = np.zeros((count, X.shape[0]))
    chosen: list[int] = []
    for k in range(min(count, X.shape[0])):
        pivot = int(np.argmax(left))
        if left[pivot] < JITTER:
            break
        row = kernel.matrix(theta, X[pivot : pivot + 1], X)[0]
        row -= factor[:k, pivot] @ factor[:k]
        factor[k] = row / np.sqrt(left[pivot])
        left = np.maximum(left - factor[k] ** 2, 0.0)
        left[pivot] = 0.0
        chosen.append(pivot)
    return np.array(chosen, dtype=np.intp)


def bound(
    model: tuple[Kernel, Noise],
    theta: Array,
    X: tuple[Array, Array],
    r: Array,
    jitter: float = JITTER,
) -> tuple[float, Array]:
    """Return the bound on the log marginal likelihood of r and its slope in theta.

    With M = (a a' - (Q + S)^-1 + S^-1)/2 the slope is tr(M dQ) - 1/2 sum dk_ii/S_ii
    and, for the noise, 1/2 sum_i [a_i^2 - (Q + S)^-1_ii + (k_ii - Q_ii)/S_ii^2] dS_ii.

    Args:
        model: kernel and noise.
        theta: the kernel's, then the noise's hyperparameters.
        X: inputs (n, d) and inducing inputs (m, d).
        r: outputs with the mean function taken off, shape (n,).
        jitter: share of the mean variance added to K_uu.
    """
    kernel, noise = model
    theta_kernel, theta_noise = split(kernel, theta)
    inputs, inducing = X
    K_uu, contract_uu = kernel.evaluate(theta_kernel, inducing, inducing)
    K_fu, contract_fu = kernel.evaluate(theta_kernel, inputs, inducing)
    S, contract_noise = noise.evaluate(theta_noise, inputs)
    part = _project(_jittered(K_uu, jitter), K_fu, S, r)
    gap = kernel.diagonal(theta_kernel, inputs) - S * np.einsum(
        "mn,mn->n", part.A, part.A
    )
    value = -0.5 * (part.quadratic + float(np.sum(np.log(S) + gap / S)))
    value -= float(np.sum(np.log(np.diagonal(part.L_b))))
    value -= 0.5 * r.size * np.log(2.0 * np.pi)
    W_fu, W_uu, of_noise = _weights(part, S, gap)
    W_uu[np.diag_indices_from(W_uu)] *= 1.0 + jitter
    slope = contract_fu(W_fu) + contract_uu(W_uu)
    slope += kernel.diagonal_slope(theta_kernel, inputs, -0.5 / S)
    return value, np.concatenate([slope, contract_noise(of_noise)])


def fit_sparse(
    inputs: Array,
    y: Array,
    kernel: Kernel | None = None,
    noise: Noise | None = None,
    inducing: int = INDUCING,
) -> SparseProcess:
    """Return a sparse Gaussian process fitted to all of `y`, its mean taken off.

    Args:
        inputs: training inputs, shape (n, d); standardised here.
        y: training outputs, shape (n,).
        kernel: covariance function, by default squared exponential.
        noise: noise of the measurements, by default constant.
        inducing: largest number of inducing points.

    Raises:
        SettingsError: fewer than 20 rows, or outputs that do not vary.
    """
    check_outputs(y)
    kernel = kernel or SquaredExponential(inputs.shape[1])
    noise = noise or ConstantNoise()
    centre, scale = inputs.mean(axis=0), spread(inputs)
    X, offset = (inputs - centre) / scale, float(y.mean())
    U, r = X[choose_inducing(X, inducing)], y - offset

    def objective(theta: Array) -> tuple[float, Array]:
        value, slope = bound((kernel, noise), theta, (X, U), r)
        prior, prior_slope = noise.log_prior(split(kernel, theta)[1])
        slope[-prior_slope.size :] += prior_slope
        return value + prior, slope

    optimum = maximise((kernel, noise), objective, X, float(np.std(r)))
    theta, theta_noise = split(kernel, optimum.theta)
    K_uu = kernel.matrix(theta, U, U)
    S = noise.variance(theta_noise, X)
    part = _project(_jittered(K_uu, JITTER), kernel.matrix(theta, X, U), S, r)
    alpha, root = _memory(part, r / np.sqrt(S))
    return SparseProcess(
        kernel=kernel,
        noise=noise,
        theta=optimum.theta,
        X=U,
        alpha=alpha,
        root=root,
        offset=offset,
        centre=centre,
        scale=scale,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=JITTER * float(np.mean(np.diagonal(K_uu))),
        at_bound=optimum.at_bound,
    )


def _jittered(K_uu: Array, jitter: float) -> Array:
    return K_uu + np.diag(jitter * np.diagonal(K_uu))


def _project(K_uu: Array, K_fu: Array, S: Array, r: Array) -> _Projection:
    from scipy.linalg import solve_triangular

    sd = np.sqrt(S)
    L_u = factorise(K_uu, np.zeros(K_uu.shape[0])).L
    A = solve_triangular(L_u, (K_fu / sd[:, None]).T, lower=True, check_finite=False)
    L_b = factorise(A @ A.T, np.ones(A.shape[0])).L
    white = r / sd
    half = solve_triangular(L_b, A @ white, lower=True, check_finite=False)
    back = solve_triangular(L_b, half, lower=True, trans=1, check_finite=False)
    a = (white - A.T @ back) / sd
    return _Projection(L_u, A, L_b, a, float(white @ white - half @ half))


def _weights(part: _Projection, S: Array, gap: Array) -> tuple[Array, Array, Array]:
    """Return the weights of dK_fu (n, m), dK_uu (m, m) and 2 dS (n,) in the slope.

    With P = K_uu^-1 K_uf they are 2 M P' and -P M P'.
    """
    from scipy.linalg import solve_triangular

    def solve(L: Array, right: Array, trans: int = 0) -> Array:
        return solve_triangular(L, right, lower=True, trans=trans, check_finite=False)

    sd, eye = np.sqrt(S), np.eye(part.L_u.shape[0])
    of_b = solve(part.L_b, eye)
    B_inverse = of_b.T @ of_b
    L_inverse = solve(part.L_u, eye)
    p_a = L_inverse.T @ (part.A @ (sd * part.a))
    inner = (eye - B_inverse) @ L_inverse
    W_fu = np.outer(part.a, p_a) + (part.A / sd).T @ inner
    BB = part.L_b @ part.L_b.T
    W_uu = -0.5 * (
        np.outer(p_a, p_a) + L_inverse.T @ (BB - 2.0 * eye + B_inverse) @ L_inverse
    )
    half = of_b @ part.A
    inverse_diagonal = (1.0 - np.einsum("mn,mn->n", half, half)) / S
    return W_fu, W_uu, part.a**2 - inverse_diagonal + gap / S**2


def _memory(part: _Projection, white: Array) -> tuple[Array, Array]:
    """Return the weights of the mean (m,) and the root of the known variance (m, m)."""
    from scipy.linalg import solve_triangular

    eye = np.eye(part.L_u.shape[0])
    L_inverse = solve_triangular(part.L_u, eye, lower=True, check_finite=False)
    of_b = solve_triangular(part.L_b, eye, lower=True, check_finite=False)
    alpha = L_inverse.T @ (of_b.T @ (of_b @ (part.A @ white)))
    # I - B^-1 is positive semidefinite with eigenvalues in [0, 1)
    values, vectors = np.linalg.eigh(eye - of_b.T @ of_b)
    return alpha, L_inverse.T @ vectors * np.sqrt(np.maximum(values, 0.0))
