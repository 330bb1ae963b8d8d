"""Fast bounds checks of short sequences, without a Python loop for in-range values.

Called a dozen times per cycle with seven values. NaN is out of range.
"""

from collections.abc import Iterable
from operator import le


def are_within(values: Iterable[float], limits: Iterable[float]) -> bool:
    """Return whether |value| <= limit for all `values`."""
    return all(map(le, map(abs, values), limits))


def are_between(
    lower: Iterable[float], values: list[float], upper: Iterable[float]
) -> bool:
    """Return whether lower <= value <= upper for all `values`."""
    return all(map(le, lower, values)) and all(map(le, values, upper))
