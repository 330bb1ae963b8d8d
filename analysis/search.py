"""The search for hyperparameters: bounded quasi-Newton from three starts, always.

One start misses the best optimum of a Gaussian process in every sixth fit or so.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.kernels import Kernel
from analysis.noise import Noise
from analysis.series import Array

Likelihood = Callable[[Array], tuple[float, Array]]

STARTS = ((1.0, 0.5), (3.0, 0.9), (1.0 / 3.0, 0.3))  # (l / sd(x), sn / sd(y))
_HOPELESS = 1e25  # objective where no jitter helps
_AT_BOUND = 1e-3


class Start(NamedTuple):
    """One start of the search and what it reached.

    Attributes:
        theta: hyperparameters at its end.
        lml: log marginal likelihood there, or a bound on it, priors included.
        evaluations: how often the likelihood was evaluated.
    """

    theta: tuple[float, ...]
    lml: float
    evaluations: int


class Optimum(NamedTuple):
    """The best hyperparameters found and every start's result."""

    theta: Array
    lml: float
    starts: tuple[Start, ...]
    at_bound: tuple[str, ...]


def maximise(
    model: tuple[Kernel, Noise], objective: Likelihood, X: Array, sd_y: float
) -> Optimum:
    """Return the hyperparameters of largest likelihood.

    Args:
        model: kernel and noise; theta is the kernel's, then the noise's.
        objective: theta -> likelihood and its slope; may raise SettingsError.
        X: inputs, shape (n, d); they set the scale of starts and bounds.
        sd_y: standard deviation of the outputs.
    """
    kernel, noise = model
    sd_x = spread(X)
    bounds = np.vstack([kernel.bounds(sd_y, sd_x), noise.bounds(sd_y)])
    reached = [
        _climb(
            objective,
            np.concatenate(
                [kernel.start(sd_y, sd_x, stretch), noise.start(sd_y, share)]
            ),
            bounds,
        )
        for stretch, share in STARTS
    ]
    best = max(reached, key=lambda start: start.lml)
    theta = np.array(best.theta)
    is_edge = np.abs(bounds - theta[:, None]).min(axis=1) < _AT_BOUND
    names = np.array([*kernel.names, *noise.names])
    return Optimum(theta, best.lml, tuple(reached), tuple(map(str, names[is_edge])))


def spread(X: Array) -> Array:
    """Return the standard deviation of every column, 1 where it does not vary."""
    sd = X.std(axis=0)
    return np.where(np.ptp(X, axis=0) > 0, sd, 1.0)


def _climb(objective: Likelihood, start: Array, bounds: Array) -> Start:
    from scipy.optimize import minimize

    def downhill(theta: Array) -> tuple[float, Array]:
        try:
            lml, slope = objective(theta)
        except SettingsError:
            return _HOPELESS, np.zeros_like(theta)
        return -lml, -slope

    found = minimize(
        downhill,
        np.clip(start, bounds[:, 0], bounds[:, 1]),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": 200, "gtol": 1e-5, "ftol": 2e-9},
    )
    theta = tuple(float(value) for value in found.x)
    return Start(theta, -float(found.fun), int(found.nfev))
