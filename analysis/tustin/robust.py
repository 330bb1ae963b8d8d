"""Tustin fits that a few wild samples cannot pull: iteratively reweighted squares."""

from typing import Literal

import numpy as np

from analysis.data.series import Array
from analysis.tustin.varpro import Point, Problem, polish, search

Loss = Literal["squares", "huber", "student"]

_HUBER = 1.345  # standard deviations; 95 % as efficient as squares on a normal
_NU = 4.0  # degrees of freedom of Student's t
_MAD_TO_SD = 1.4826  # of a normal
_ROUNDS = 5


def search_robustly(problem: Problem, loss: Loss) -> tuple[Problem, list[Point]]:
    """Return the reweighted problem and its optima, best first.

    The scale is 1.4826 times the median absolute residual. Every round refreshes scale
    and weights and polishes from the last optimum; the last round searches the whole
    grid again, so that the optimum is one of the weighted problem.
    """
    point = search(problem)[0]
    for _ in range(_ROUNDS):
        residual = problem.residual(point)
        scale = _MAD_TO_SD * float(np.median(np.abs(residual)))
        if scale <= 0:  # half of the samples are fitted exactly
            break
        problem = problem.reweighted(weigh(residual / scale, loss))
        point = polish(problem, point.q)
    return problem, search(problem)


def weigh(z: Array, loss: Loss) -> Array:
    """Return the weights psi(z)/z of standardised residuals z, shape (n,)."""
    if loss == "huber":
        return np.minimum(1.0, _HUBER / np.maximum(np.abs(z), _HUBER))
    if loss == "student":
        return (_NU + 1.0) / (_NU + z * z)
    return np.ones(z.size)
