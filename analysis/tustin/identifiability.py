"""Identifiability of the Tustin parameters from the samples."""

from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.tustin.varpro import Point, Problem

_SINGULAR = 1e8  # condition number of the scaled Gram matrix
_UNCORRELATED = 0.05
_WIDE = 10.0  # ratio of an interval's ends above which it is uninformative


class Interval(NamedTuple):
    """Interval of a parameter.

    Attributes:
        lower: lower end.
        upper: upper end.
    """

    lower: float
    upper: float


class Profiles(NamedTuple):
    """Profile intervals of the two shape parameters.

    Attributes:
        v_s: 95 % interval of the Stribeck velocity [m/s].
        delta_s: 95 % interval of the Stribeck exponent [-].
        touches_edge: an interval ends at the edge of the search.
    """

    v_s: Interval
    delta_s: Interval
    touches_edge: bool

    @property
    def are_closed(self) -> bool:
        """Whether both intervals end inside the search and span at most a factor 10."""
        widths = (self.v_s.upper / self.v_s.lower, self.delta_s.upper / self.delta_s[0])
        return not self.touches_edge and max(widths) <= _WIDE


def is_identifiable(problem: Problem, point: Point) -> bool:
    """Return whether the three linear columns are independent at the optimum."""
    A = problem.design(point.q)
    length = np.linalg.norm(A, axis=0)
    if length.min() == 0:
        return False
    return float(np.linalg.cond((A / length).T @ (A / length))) <= _SINGULAR


def is_straight(problem: Problem, point: Point) -> bool:
    """Return whether mu F_n + b v_t + F_0 fits as well as the full model.

    Criterion: its SSE is below (1 + 4/n_eff) times the model's, with n_eff the number
    of independent samples.
    """
    line = np.column_stack([problem.F_n, problem.v_t, np.ones(problem.v_t.size)])
    root = np.sqrt(problem.weights)
    solution = np.linalg.lstsq(line * root[:, None], problem.F_t * root, rcond=None)[0]
    sse = float(problem.weights @ (line @ solution - problem.F_t) ** 2)
    independent = independent_samples(problem.residual(point))
    return sse < (1.0 + 4.0 / independent) * point.sse


def independent_samples(residual: Array) -> float:
    """Effective number of independent samples of a residual (n,): n/tau."""
    return residual.size / correlation_samples(residual)


def correlation_samples(residual: Array) -> float:
    """Integrated autocorrelation time of a residual [samples], at least 1.

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
