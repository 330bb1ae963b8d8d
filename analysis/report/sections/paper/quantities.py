"""What was measured of a statement, and how its numbers are put in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from analysis.study.metrics import (
    PairedComparison,
    adjusted_by_holm,
    smallest_adjusted,
)

SIGNIFICANT = 0.05  # adjusted p below which a difference is one


@dataclass(frozen=True, slots=True)
class ClaimResult:
    """What a study shows of a statement.

    Attributes:
        text: in words, with numbers.
        numbers: the same as numbers, SI units, shares as 1.
        further: quantities that only bounds are held against.
    """

    text: str
    numbers: Mapping[str, float]
    further: Mapping[str, float] = field(default_factory=dict[str, float])


def ends_of(values: Sequence[float], form: str) -> str:
    """Return the smallest and the largest value as text, one where they agree."""
    low, high = (format(end, form) for end in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def beyond_chance(pairs: Sequence[PairedComparison], sign: int, unit: str) -> str:
    """Return how many of the pairs differ beyond chance, and whether they could."""
    text = f"{count_significant(pairs, sign)} of {len(pairs)} {unit}"
    if smallest_adjusted(pairs) < SIGNIFICANT:
        return text
    trials = min(pair.trials for pair in pairs)
    return f"{text} ({trials} trials are too few to show it of {len(pairs)})"


def count_significant(pairs: Sequence[PairedComparison], sign: int) -> int:
    """Return how many differences of a sign hold for all comparisons together."""
    adjusted = adjusted_by_holm([pair.p for pair in pairs])
    return sum(
        p < SIGNIFICANT and sign * pair.difference > 0
        for p, pair in zip(adjusted, pairs, strict=True)
    )
