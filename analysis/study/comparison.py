"""Whether one model is better than another, by the trials that both were tested on."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array

_EXACT = 14  # trials up to which every pattern of signs is tried
_PATTERNS = 20_000  # random ones beyond that


class Paired(NamedTuple):
    """A paired comparison over trials.

    Attributes:
        difference: mean of the second minus the first.
        standard_error: of that mean; None for one trial.
        p: probability of a mean difference this large if the models were equal.
        trials: number of trials with both.
    """

    difference: float
    standard_error: float | None
    p: float
    trials: int


def compare(
    first: Sequence[float | None], second: Sequence[float | None]
) -> Paired | None:
    """Return the comparison of two models' errors per trial, None without a pair.

    The trial is the independent unit. Under equality the sign of every difference is a
    toss: p is the share of all patterns of signs with a mean at least as large.
    """
    pairs = [
        (a, b)
        for a, b in zip(first, second, strict=True)
        if a is not None and b is not None
    ]
    if not pairs:
        return None
    difference = np.array([b - a for a, b in pairs])
    count, mean = difference.size, float(difference.mean())
    error = float(difference.std(ddof=1) / np.sqrt(count)) if count > 1 else None
    tossed = _signs(count) @ np.abs(difference) / count
    # rounding must not part a pattern from its mirror image
    is_as_large = np.abs(tossed) >= abs(mean) * (1.0 - 1e-12)
    return Paired(mean, error, float(np.mean(is_as_large)), count)


def standard_error(values: Sequence[float | None]) -> float | None:
    """Return the standard error of the mean over trials, None below two of them."""
    present = [value for value in values if value is not None]
    if len(present) < 2:
        return None
    return float(np.std(present, ddof=1) / np.sqrt(len(present)))


def _signs(count: int) -> Array:
    if count <= _EXACT:
        return np.array(list(product((-1.0, 1.0), repeat=count)))
    return np.random.default_rng(0).choice([-1.0, 1.0], (_PATTERNS, count))
