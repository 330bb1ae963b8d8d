"""One line of the table of measurements: what every benchmark returns."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class BenchRow:
    """One measurement, beside its goal.

    Attributes:
        what: is measured, in words.
        value: that was found; None where it could not be measured.
        unit: of value and goal.
        goal: that is to be met; None for none.
        is_least: the value is to be at least the goal, not at most.
        note: what a reader should know of the value, or why there is none.
    """

    what: str
    value: float | None
    unit: str
    goal: float | None = None
    is_least: bool = False
    note: str = ""

    @property
    def verdict(self) -> str:
        """Whether the goal is met, in a word; empty without a goal or a value."""
        if self.goal is None or self.value is None:
            return ""
        is_met = self.value >= self.goal if self.is_least else self.value <= self.goal
        return "met" if is_met else "not met"

    def cells(self) -> tuple[str, str, str, str]:
        """Return what, today, goal and verdict as text."""
        today = f"{self.value:.3g} {self.unit}" if self.value is not None else "-"
        sign = "≥" if self.is_least else "≤"
        goal = "" if self.goal is None else f"{sign} {self.goal:g} {self.unit}"
        note = f" ({self.note})" if self.note else ""
        return (self.what + note, today.strip(), goal.strip(), self.verdict)

    def plain(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def not_installed(what: str, goal: float) -> BenchRow:
    """Return the line of a comparison with a library that is not there."""
    return BenchRow(what, None, "times", goal, True, "not installed")
