"""scikit-learn for comparison: the same kernels, starts and bounds in its interface."""

import warnings
from collections.abc import Sequence

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import (
    RBF,
    ConstantKernel,
    Hyperparameter,
    Kernel,
    WhiteKernel,
)

from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.noise import ConstantNoise
from analysis.gp.proposals import initial_points
from analysis.gp.search import posterior_search

_STARTS = 3
KERNELS = {"SE fit": SquaredExponential(), "NN fit": Arcsine()}


class NeuralNetwork(Kernel):
    """The arcsine kernel of unit variance as a scikit-learn kernel."""

    def __init__(self, lengths: object = (1.0, 1.0), beta: float = 1.0) -> None:
        self.lengths, self.beta = lengths, beta

    @property
    def hyperparameter_lengths(self) -> Hyperparameter:
        """Length scales, one per input."""
        return Hyperparameter("lengths", "numeric", (np.exp(-4), np.exp(6)), 2)

    @property
    def hyperparameter_beta(self) -> Hyperparameter:
        """Variance of the bias."""
        return Hyperparameter("beta", "numeric", (np.exp(-6), np.exp(6)))

    def __call__(self, X, Y=None, eval_gradient=False):  # noqa: ANN001, ANN204
        """Return the covariances and, with `eval_gradient`, their derivatives."""
        lengths = np.asarray(self.lengths)
        Y = X if Y is None else Y
        Z, Z_other = 2.0 * X / lengths**2, Y
        N = self.beta + Z @ Z_other.T
        A = 1.0 + self.beta + np.sum(Z * X, axis=1)
        B = 1.0 + self.beta + np.sum(2.0 * Y * Y / lengths**2, axis=1)
        root = np.sqrt(np.outer(A, B))
        u = np.clip(N / root, -1.0, 1.0)
        K = np.arcsin(u)
        if not eval_gradient:
            return K
        q = 1.0 / np.sqrt(1.0 - u * u)
        slopes = []
        for d in range(X.shape[1]):
            of_X, of_Y = X[:, d] ** 2 / A, Y[:, d] ** 2 / B
            part = -4.0 * np.outer(X[:, d], Y[:, d]) / root
            slopes.append(q * (part + 2.0 * u * np.add.outer(of_X, of_Y))
                          / lengths[d] ** 2)  # fmt: skip
        bias = self.beta * q * (1.0 / root - 0.5 * u * np.add.outer(1.0 / A, 1.0 / B))
        return K, np.stack([bias, *slopes], axis=-1)

    def diag(self, X):  # noqa: ANN001, ANN201
        """Return the variances."""
        p = self.beta + np.sum(2.0 * (X / np.asarray(self.lengths)) ** 2, axis=1)
        return np.arcsin(p / (1.0 + p))

    def is_stationary(self) -> bool:
        """Return False: the kernel is not stationary."""
        return False


def sklearn_kernel(part: str, start: np.ndarray, sd: float) -> Kernel:
    """Return scikit-learn's kernel at a start and with the bounds of this project."""
    sf, *lengths, sn = np.exp(start)
    shape: Kernel = (
        RBF(lengths, (np.exp(-4), np.exp(6)))
        if part == "SE fit"
        else NeuralNetwork(tuple(lengths[:2]), lengths[2])
    )
    size = ConstantKernel(sf**2, (sd**2 * np.exp(-12), sd**2 * np.exp(8)))
    span = (sd**2 * np.exp(-12), sd**2 * np.exp(4))
    return size * shape + WhiteKernel(sn**2, span)


def three_starts(part: str, X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return three initial thetas: start and design points of this project's search."""
    kernel, noise = KERNELS[part], ConstantNoise()
    starts = posterior_search(kernel, noise, X, y).start_points
    sd = float(y.std())
    design = [
        np.concatenate([point, noise.start(sd)])
        for point in initial_points(kernel, sd, np.ones(X.shape[1]))
    ]
    return (*starts, *design)[:_STARTS]


def fit_sklearn(
    part: str, X: np.ndarray, y: np.ndarray, starts: Sequence[np.ndarray]
) -> GaussianProcessRegressor:
    """Fit scikit-learn's model from each start and return the most likely one.

    The starts are given: the time to choose them counts only for this project.
    """
    models, sd = [], float(y.std())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # length scales may end at their bounds
        for start in starts:
            model = GaussianProcessRegressor(
                sklearn_kernel(part, start, sd), alpha=1e-10
            )
            models.append(model.fit(X, y))
    return max(models, key=lambda model: model.log_marginal_likelihood_value_)
