"""Formatting of table cells: errors, bounds and p-values."""

from collections.abc import Sequence

from analysis.study.metrics import (
    PairedComparison,
    adjusted_by_holm,
    smallest_adjusted,
    standard_error,
)
from analysis.study.terrain_fit import mean_of
from analysis.tustin.identifiability import Interval
from analysis.tustin.model import TustinBounds


def interval_text(bounds: TustinBounds, key: str, interval: Interval) -> str:
    """Format an interval; ends on a bound become inequalities."""
    low, high = (bounded_text(bounds, key, end) for end in interval)
    return low if low == high else f"{low} to {high}"


def bounded_text(bounds: TustinBounds, key: str, value: float) -> str:
    """Format a parameter; on a bound of the search it becomes an inequality."""
    side = bounds.reached(key, value)
    mark = {"lower": "≤ ", "upper": "≥ "}[side] if side else ""
    return f"{mark}{value:.3g}"


def with_error(values: Sequence[float | None], form: str = ".3f") -> str:
    """Format the mean over trials ± its standard error."""
    mean, error = mean_of(values), standard_error(values)
    if mean is None:
        return "–"
    return f"{mean:{form}}" + ("" if error is None else f" ± {error:{form}}")


def paired_cells(pairs: Sequence[PairedComparison | None]) -> list[str]:
    """Format the comparisons of one table, with raw and adjusted p values."""
    adjusted = iter(adjusted_by_holm([pair.p for pair in pairs if pair is not None]))
    return [
        paired_cell(pair, None if pair is None else next(adjusted)) for pair in pairs
    ]


def paired_cell(paired: PairedComparison | None, adjusted: float | None = None) -> str:
    """Format a comparison, with the adjusted p value if given."""
    if paired is None:
        return "–"
    error = "" if paired.standard_error is None else f" ± {paired.standard_error:.3f}"
    holm = "" if adjusted is None else f", Holm {adjusted:.2g}"
    return f"{paired.difference:+z.3f}{error} (p {paired.p:.2g}{holm})"


def holm_note(pairs: Sequence[PairedComparison | None]) -> str:
    """Explain how p is adjusted for the comparisons of a table."""
    present = [pair for pair in pairs if pair is not None]
    return (
        f"Holm: p adjusted for the {len(present)} comparisons of this table; a "
        "difference with p of 0.05 or more may be chance. With so many comparisons and "
        f"so few trials the smallest possible p is {smallest_adjusted(present):.2g}."
    )


def number_text(value: float | None, digits: int = 2) -> str:
    """Format a number with this many decimals; a dash for None."""
    return "–" if value is None else f"{value:.{digits}f}"
