"""Kaplan-Meier curve of pushes, and a goodness-of-fit check based on it."""

from dataclasses import dataclass

import numpy as np

from analysis.data.series import Array

_KOLMOGOROV = 1.36  # 95 % quantile of sqrt(n) times the largest difference


@dataclass(frozen=True, slots=True)
class SurvivalCurve:
    """Kaplan-Meier step curve.

    Attributes:
        at: values of the events, increasing, shape (n,).
        below: estimated probability of at most each value, shape (n,).
    """

    at: Array
    below: Array

    def share_below(self, values: Array) -> Array:
        """Return the probability of at most each of `values`, same shape."""
        steps = np.concatenate([[0.0], self.below])
        return steps[np.searchsorted(self.at, values, "right")]


def kaplan_meier(values: Array, is_held: np.ndarray) -> SurvivalCurve:
    """Estimate the curve of partly right-censored values.

    Args:
        values: peaks, shape (n,).
        is_held: which are censored, shape (n,); events precede censoring at ties.
    """
    at, events = np.unique(values[~is_held], return_counts=True)
    at_risk = values.size - np.searchsorted(np.sort(values), at, "left")
    below = 1.0 - np.cumprod(1.0 - events / at_risk)
    return SurvivalCurve(at, below.astype(np.float64))


def pit_distance(pit: Array, is_held: np.ndarray) -> float:
    """Return the distance of probability integral transforms from uniform, 0 to 1.

    The transform of a push is the model's probability of a smaller peak. If the model
    is right, the Kaplan-Meier curve of the transforms is that of uniform numbers; the
    result is the largest difference. NaN without a slip.

    Args:
        pit: transforms, shape (n,).
        is_held: which pushes held, shape (n,).
    """
    curve = kaplan_meier(pit, is_held)
    if not curve.at.size:
        return float("nan")
    before = np.concatenate([[0.0], curve.below[:-1]])
    distance = np.maximum(np.abs(curve.below - curve.at), np.abs(before - curve.at))
    return float(distance.max())


def pit_limit(slips: int) -> float:
    """Return the distance exceeded by chance in 5 % of cases."""
    return _KOLMOGOROV / float(np.sqrt(max(slips, 1)))
