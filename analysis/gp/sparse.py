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

from analysis.data.series import Array, Indices
from analysis.gp.kernels import Kernel, SquaredExponential
from analysis.gp.likelihood import split
from analysis.gp.noise import ConstantNoise, Noise
from analysis.gp.regression import check_outputs
from analysis.gp.search import Objective, Start, maximise, spread
from analysis.gp.sparse_bound import JITTER, bound, jittered, project

INDUCING = 32

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

    model = (kernel, noise)
    optimum = maximise(model, _posterior(model, (X, U), r), X, float(np.std(r)))
    memory = _memorise(model, optimum.theta, (X, U), r)
    return SparseProcess(
        kernel=kernel,
        noise=noise,
        theta=optimum.theta,
        X=U,
        alpha=memory.alpha,
        root=memory.root,
        offset=offset,
        centre=centre,
        scale=scale,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=memory.jitter,
        at_bound=optimum.at_bound,
    )


def _posterior(
    model: tuple[Kernel, Noise], X: tuple[Array, Array], r: Array
) -> Objective:
    kernel, noise = model

    def objective(theta: Array) -> tuple[float, Array]:
        value, slope = bound(model, theta, X, r)
        prior, prior_slope = noise.log_prior(split(kernel, theta)[1])
        slope[-prior_slope.size :] += prior_slope
        return value + prior, slope

    return objective


class _Memory(NamedTuple):
    """What a process remembers: see `SparseProcess`."""

    alpha: Array
    root: Array
    jitter: float


def _memorise(
    model: tuple[Kernel, Noise], theta: Array, X: tuple[Array, Array], r: Array
) -> _Memory:
    """Return weights of the mean (m,), root of the known variance (m, m), jitter."""
    from scipy.linalg import solve_triangular

    (kernel, noise), (inputs, inducing) = model, X
    theta_kernel, theta_noise = split(kernel, theta)
    K_uu = kernel.matrix(theta_kernel, inducing, inducing)
    K_fu = kernel.matrix(theta_kernel, inputs, inducing)
    S = noise.variance(theta_noise, inputs)
    part = project(jittered(K_uu, JITTER), K_fu, S, r)
    eye = np.eye(part.L_u.shape[0])
    L_inverse = solve_triangular(part.L_u, eye, lower=True, check_finite=False)
    of_b = solve_triangular(part.L_b, eye, lower=True, check_finite=False)
    alpha = L_inverse.T @ (of_b.T @ (of_b @ (part.A @ (r / np.sqrt(S)))))
    # I - B^-1 is positive semidefinite with eigenvalues in [0, 1)
    values, vectors = np.linalg.eigh(eye - of_b.T @ of_b)
    root = L_inverse.T @ vectors * np.sqrt(np.maximum(values, 0.0))
    return _Memory(alpha, root, JITTER * float(np.mean(np.diagonal(K_uu))))
