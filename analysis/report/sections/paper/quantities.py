"""Measured quantities of a statement and their formatting."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from analysis.study.metrics import (
    PairedComparison,
    adjusted_by_holm,
    smallest_adjusted,
)

SIGNIFICANT = 0.05  # adjusted p below which a difference is significant


@dataclass(frozen=True, slots=True)
class ClaimResult:
    """Result of a study for a statement.

    Attributes:
        text: result in words, with numbers.
        numbers: the numbers in SI units, shares as 1.
        further: quantities used only by the bounds.
    """

    text: str
    numbers: Mapping[str, float]
    further: Mapping[str, float] = field(default_factory=dict[str, float])


def ends_of(values: Sequence[float], form: str) -> str:
    """Format the smallest and the largest value; one value if they agree."""
    low, high = (format(end, form) for end in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def beyond_chance(pairs: Sequence[PairedComparison], sign: int, unit: str) -> str:
    """State how many pairs differ beyond chance, and whether the trials suffice."""
    text = f"{count_significant(pairs, sign)} of {len(pairs)} {unit}"
    if smallest_adjusted(pairs) < SIGNIFICANT:
        return text
    trials = min(pair.trials for pair in pairs)
    return f"{text} ({trials} trials are too few to show a difference in {len(pairs)})"


def count_significant(pairs: Sequence[PairedComparison], sign: int) -> int:
    """Count the differences of a sign that are significant after Holm's adjustment."""
    adjusted = adjusted_by_holm([pair.p for pair in pairs])
    return sum(
        p < SIGNIFICANT and sign * pair.difference > 0
        for p, pair in zip(adjusted, pairs, strict=True)
    )
