"""Local maximisation of a log density by L-BFGS-B in a box.

SciPy's implementation of Byrd, Lu, Nocedal and Zhu (1995), SIAM J. Sci. Comput. 16: a
quasi-Newton method with bounds, for few parameters and an expensive gradient.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array

# theta -> value and slope; raises SettingsError where the density is undefined
Objective = Callable[[Array], tuple[float, Array]]

# a climb ends when a step gains less than this share of the value
_TOLERANCE = 2e-9
# where the density is undefined, the optimiser sees the lowest value so far less this:
# low enough to be rejected, but not so low that the line search shortens to nothing
_DROP = 100.0


class ClimbResult(NamedTuple):
    """Result of a climb.

    Attributes:
        theta: final parameters, shape (p,).
        value: log density there; -inf if it is undefined at the start.
        evaluations: number of evaluations.
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
) -> ClimbResult:
    """Climb from a start to a local maximum.

    Args:
        objective: theta -> value and slope.
        start: initial theta, shape (p,); clipped to the box. If the density is
            undefined there, the climb ends at once.
        bounds: bounds of theta, shape (p, 2).
        is_known: theta, value -> whether to stop there.
        scale: parameter scale that equalises the curvature, shape (p,); saves the
            steps in which the method would learn it.
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

    def stop_at_known(intermediate_result: Any) -> None:  # noqa: ANN401
        if is_known(inside(intermediate_result.x), -float(intermediate_result.fun)):
            raise StopIteration

    result = minimize(
        downhill,
        np.clip(start, *bounds.T) / scale,
        jac=True,
        method="L-BFGS-B",
        bounds=(bounds.T / scale).T,
        callback=stop_at_known,
        options={"ftol": _TOLERANCE},
    )
    value = -float(result.fun) if has_value else -np.inf
    return ClimbResult(inside(result.x), value, int(result.nfev))
