"""Row of the table of measurements, as returned by every benchmark."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class BenchRow:
    """One measurement and its goal.

    Attributes:
        what: description of the measured quantity.
        value: measured value; None if it could not be measured.
        unit: unit of value and goal.
        goal: bound on the value; None = no goal.
        is_lower_bound: the goal is a lower bound, not an upper one.
        note: remark on the value, or why it is missing.
    """

    what: str
    value: float | None
    unit: str
    goal: float | None = None
    is_lower_bound: bool = False
    note: str = ""

    @property
    def verdict(self) -> str:
        """Verdict "met" or "not met"; empty without a goal or a value."""
        if self.goal is None or self.value is None:
            return ""
        is_met = (
            self.value >= self.goal if self.is_lower_bound else self.value <= self.goal
        )
        return "met" if is_met else "not met"

    def cells(self) -> tuple[str, str, str, str]:
        """Return description, measured value, goal and verdict as text."""
        measured = f"{self.value:.3g} {self.unit}" if self.value is not None else "-"
        sign = "≥" if self.is_lower_bound else "≤"
        goal = "" if self.goal is None else f"{sign} {self.goal:g} {self.unit}"
        note = f" ({self.note})" if self.note else ""
        return (self.what + note, measured.strip(), goal.strip(), self.verdict)

    def plain(self) -> dict[str, Any]:
        """Return the row as a dictionary for JSON."""
        return asdict(self)


def not_installed(what: str, goal: float) -> BenchRow:
    """Return the row of a comparison with a library that is not installed."""
    return BenchRow(what, None, "times", goal, True, "not installed")
