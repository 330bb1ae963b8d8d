"""One climb to a top of a log density, by L-BFGS-B in a box.

The method of Byrd, Lu, Nocedal and Zhu (1995), SIAM J. Sci. Comput. 16, as SciPy has
it: a quasi-Newton method with bounds, for few parameters and an expensive slope.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array

# theta -> value and slope; may raise SettingsError where there is no value
Objective = Callable[[Array], tuple[float, Array]]

# a climb ends where a step gains less than this share of the value
_TOLERANCE = 2e-9
# where there is no value a climb meets one that is so much below the lowest it has met:
# low enough to be turned down, and not so low that the next step would be next to none
_DROP = 100.0


class Climbed(NamedTuple):
    """Where a climb ended.

    Attributes:
        theta: parameters, shape (p,).
        value: the log density there; -inf where the start has none.
        evaluations: how often it was evaluated.
    """

    theta: Array
    value: float
    evaluations: int


def climb(
    objective: Objective,
    start: Array,
    bounds: Array,
    is_known: Callable[[Array, float], bool] = lambda theta, value: False,
    scale: Array | float = 1.0,
) -> Climbed:
    """Return the top that a start leads to.

    Args:
        objective: theta -> value and slope.
        start: theta to begin with, shape (p,); clipped into the box. One without a
            value is where the climb ends.
        bounds: of theta, shape (p, 2).
        is_known: theta, value -> whether the climb is left there.
        scale: in which the density bends alike along every parameter, shape (p,):
            fewer steps are lost until the method has learnt how it does.
    """
    from scipy.optimize import minimize

    lowest, has_value = 0.0, False

    def inside(scaled: Array) -> Array:
        return np.clip(scaled * scale, *bounds.T)

    def downhill(scaled: Array) -> tuple[float, Array]:
        nonlocal lowest, has_value
        theta = inside(scaled)
        try:
            value, slope = objective(theta)
        except SettingsError:
            return _DROP - lowest, np.zeros_like(theta)
        lowest, has_value = min(lowest, value), True
        return -value, -slope * scale

    def watch(intermediate_result: Any) -> None:  # noqa: ANN401
        if is_known(inside(intermediate_result.x), -float(intermediate_result.fun)):
            raise StopIteration

    found = minimize(
        downhill,
        np.clip(start, *bounds.T) / scale,
        jac=True,
        method="L-BFGS-B",
        bounds=(bounds.T / scale).T,
        callback=watch,
        options={"ftol": _TOLERANCE},
    )
    value = -float(found.fun) if has_value else -np.inf
    return Climbed(inside(found.x), value, int(found.nfev))
