"""Many numbers against their limits at once: the usual answer without a loop of ours.

Seven numbers are looked at in every cycle, a dozen times. What is no number is within
nothing.
"""

from collections.abc import Iterable
from operator import le


def are_within(values: Iterable[float], limits: Iterable[float]) -> bool:
    """Return whether every magnitude of `values` is at most its limit."""
    return all(map(le, map(abs, values), limits))


def are_between(
    lower: Iterable[float], values: list[float], upper: Iterable[float]
) -> bool:
    """Return whether every one of `values` is between its bounds, or on one."""
    return all(map(le, lower, values)) and all(map(le, values, upper))
