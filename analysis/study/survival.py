"""What the pushes show without a model: Kaplan and Meier's curve, and a check by it."""

from dataclasses import dataclass

import numpy as np

from analysis.data.series import Array

_KOLMOGOROV = 1.36  # 95 % point of sqrt(n) times the largest difference


@dataclass(frozen=True, slots=True)
class SurvivalCurve:
    """A step curve of Kaplan and Meier.

    Attributes:
        at: values at which there is an event, increasing, shape (n,).
        below: estimated probability of no more than each of them, shape (n,).
    """

    at: Array
    below: Array

    def share_below(self, values: Array) -> Array:
        """Return the probability of no more than each of `values`, their shape."""
        steps = np.concatenate([[0.0], self.below])
        return steps[np.searchsorted(self.at, values, "right")]


def kaplan_meier(values: Array, is_held: np.ndarray) -> SurvivalCurve:
    """Return the curve of values of which some are right-censored.

    Args:
        values: peaks, shape (n,).
        is_held: which are censored, shape (n,); at equal values events come first.
    """
    at, events = np.unique(values[~is_held], return_counts=True)
    at_risk = values.size - np.searchsorted(np.sort(values), at, "left")
    below = 1.0 - np.cumprod(1.0 - events / at_risk)
    return SurvivalCurve(at, below.astype(np.float64))


def pit_distance(pit: Array, is_held: np.ndarray) -> float:
    """Return how far probability integral transforms are from uniform, 0 to 1.

    The transform of a push is the probability that its model gives to a smaller peak.
    Kaplan and Meier's curve of the transforms is that of uniform numbers where the
    model is right; the result is the largest difference. NaN without a slip.

    Args:
        pit: transforms, shape (n,).
        is_held: which pushes held, shape (n,).
    """
    curve = kaplan_meier(pit, is_held)
    if not curve.at.size:
        return float("nan")
    before = np.concatenate([[0.0], curve.below[:-1]])
    apart = np.maximum(np.abs(curve.below - curve.at), np.abs(before - curve.at))
    return float(apart.max())


def pit_limit(slips: int) -> float:
    """Return the distance that chance exceeds in 5 % of cases."""
    return _KOLMOGOROV / float(np.sqrt(max(slips, 1)))
