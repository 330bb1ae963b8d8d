"""What the samples can and cannot say about the Tustin parameters."""

import numpy as np

from analysis.series import Array
from analysis.varpro import Point, Problem

_SINGULAR = 1e8  # condition number of the scaled Gram matrix
_UNCORRELATED = 0.05


def is_identifiable(problem: Problem, point: Point) -> bool:
    """Return whether the three linear columns can be told apart at the optimum."""
    A = problem.design(point.q)
    length = np.linalg.norm(A, axis=0)
    if length.min() == 0:
        return False
    return float(np.linalg.cond((A / length).T @ (A / length))) <= _SINGULAR


def is_straight(problem: Problem, point: Point) -> bool:
    """Return whether mu F_n + b v_t + F_0 does as well as the whole model.

    As well: its SSE is below (1 + 4/n_eff) times the model's, with n_eff the number of
    independent samples.
    """
    line = np.column_stack([problem.F_n, problem.v_t, np.ones(problem.v_t.size)])
    solution = np.linalg.lstsq(line, problem.F_t, rcond=None)[0]
    sse = float(np.sum((line @ solution - problem.F_t) ** 2))
    residual = problem.design(point.q) @ point.p - problem.F_t
    independent = problem.F_t.size / correlation_samples(residual)
    return sse < (1.0 + 4.0 / independent) * point.sse


def correlation_samples(residual: Array) -> float:
    """Return the integrated autocorrelation time of a residual [samples], >= 1.

    The sum ends where the correlation first falls below 0.05.
    """
    centred = residual - residual.mean()
    power = float(centred @ centred)
    total = 1.0
    for lag in range(1, centred.size // 2):
        correlation = float(centred[lag:] @ centred[:-lag]) / power if power else 0.0
        if correlation < _UNCORRELATED:
            break
        total += 2.0 * correlation
    return total
