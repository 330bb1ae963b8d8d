"""The top that a start leads to by L-BFGS-B in a box, and what searches hand round."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from acquisition import SettingsError
from analysis.data import Array

# theta -> value and slope; may raise SettingsError
Objective = Callable[[Array], tuple[float, Array]]

HOPELESS = 1e25  # minus the value where no jitter helps


class Start(NamedTuple):
    """One start of the search and what it reached.

    Attributes:
        theta: hyperparameters at its end: a top, or just below the top of another.
        lml: log marginal likelihood there, priors included.
        evaluations: how often the exact likelihood was evaluated.
    """

    theta: tuple[float, ...]
    lml: float
    evaluations: int


class SearchBox(NamedTuple):
    """Where theta is sought.

    Attributes:
        bounds: of theta, shape (p, 2).
        steps: size of its steps, shape (p,).
    """

    bounds: Array
    steps: Array

    def around(self, theta: Array, reach: float) -> "SearchBox":
        """Return the part of the box that is no further than `reach` from theta."""
        low, high = np.clip([theta - reach, theta + reach], *self.bounds.T)
        return self._replace(bounds=np.column_stack([low, high]))


def maximised(
    objective: Objective,
    theta: Array,
    box: SearchBox,
    until: tuple[float, Callable[[Array, float], bool] | None],
) -> Start:
    """Return the top of an objective that theta leads to.

    Args:
        objective: theta -> value and slope.
        theta: to begin with.
        box: where it is sought.
        until: relative change of the value that ends it, and what ends it at once.
    """
    from scipy.optimize import OptimizeResult, minimize

    (bounds, steps), (tolerance, is_enough) = box, until

    def downhill(x: Array) -> tuple[float, Array]:
        value, slope = tried(objective, x * steps)
        return -value, -slope * steps

    def look(intermediate_result: OptimizeResult) -> None:
        if is_enough and is_enough(
            intermediate_result.x * steps, -intermediate_result.fun
        ):
            raise StopIteration

    optimum = minimize(
        downhill,
        theta / steps,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds / steps[:, None],
        callback=look,
        options={"maxiter": 200, "gtol": 1e-5, "ftol": tolerance},
    )
    reached = tuple((optimum.x * steps).tolist())
    return Start(reached, -float(optimum.fun), int(optimum.nfev))


def tried(objective: Objective, theta: Array) -> tuple[float, Array]:
    """Return value and slope; hopeless where the covariance cannot be factorised."""
    try:
        return objective(theta)
    except SettingsError:
        return -HOPELESS, np.zeros_like(theta)
