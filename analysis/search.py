"""The search for hyperparameters: bounded quasi-Newton from three starts, always.

One start misses the best optimum of a Gaussian process in every fourth fit or so. A
start that comes to stand just below a top that was reached before is left there.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.kernels import Kernel
from analysis.noise import Noise
from analysis.series import Array

Objective = Callable[[Array], tuple[float, Array]]

_HOPELESS = 1e25  # objective where no jitter helps
_AT_BOUND = 1e-3
_NOISE_STEP = 0.1  # the likelihood bends most along the noise: its steps are shorter
_SAME_TOP = (0.2, 0.1)  # largest difference of thetas, and of likelihoods


class Start(NamedTuple):
    """One start of the search and what it reached.

    Attributes:
        theta: hyperparameters at its end: a top, or just below the top of another.
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
    model: tuple[Kernel, Noise],
    objective: Objective,
    X: Array,
    sd_y: float,
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
    steps = np.repeat([1.0, _NOISE_STEP], [len(kernel.names), len(noise.names)])
    reached: list[Start] = []
    for start in kernel.starts(sd_y, sd_x):
        begin = np.concatenate([start, noise.start(sd_y)])
        reached.append(_climb(objective, begin, (bounds, steps), reached))
    best = max(reached, key=lambda start: start.lml)
    theta = np.array(best.theta)
    is_edge = np.abs(bounds - theta[:, None]).min(axis=1) < _AT_BOUND
    names = np.array([*kernel.names, *noise.names])
    return Optimum(theta, best.lml, tuple(reached), tuple(map(str, names[is_edge])))


def spread(X: Array) -> Array:
    """Return the standard deviation of every column, 1 where it does not vary."""
    sd = X.std(axis=0)
    return np.where(np.ptp(X, axis=0) > 0, sd, 1.0)


def _climb(
    objective: Objective,
    start: Array,
    box: tuple[Array, Array],
    known: Sequence[Start],
) -> Start:
    """Return where a start ends: on a top, or just below one of those known.

    Args:
        objective: theta -> likelihood and its slope.
        start: theta to begin with.
        box: bounds of theta, shape (p, 2), and the size of its steps, shape (p,).
        known: what other starts have reached.
    """
    from scipy.optimize import OptimizeResult, minimize

    bounds, steps = box

    def downhill(x: Array) -> tuple[float, Array]:
        try:
            lml, slope = objective(x * steps)
        except SettingsError:
            return _HOPELESS, np.zeros_like(x)
        return -lml, -slope * steps

    def look(intermediate_result: OptimizeResult) -> None:
        if _is_below(intermediate_result.x * steps, -intermediate_result.fun, known):
            raise StopIteration

    found = minimize(
        downhill,
        np.clip(start, bounds[:, 0], bounds[:, 1]) / steps,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds / steps[:, None],
        callback=look,
        options={"maxiter": 200, "gtol": 1e-5, "ftol": 2e-9},
    )
    theta = tuple(float(value) for value in found.x * steps)
    return Start(theta, -float(found.fun), int(found.nfev))


def _is_below(theta: Array, lml: float, known: Sequence[Start]) -> bool:
    """Return whether theta is just below a known top."""
    near, low = _SAME_TOP
    return any(
        top.lml - low < lml <= top.lml and np.abs(theta - top.theta).max() < near
        for top in known
    )
