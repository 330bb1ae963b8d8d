"""A trial on the disk: its name, and the sidecar with what is known of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from acquisition.trial_file.verify import VerifiedFile

TIME_LIMIT = 30.0  # s, a trial is over then
COMPLETE = frozenset({"travel", "key", "time-limit"})


@dataclass(frozen=True, slots=True)
class TrialName:
    """Number and attempt of a trial: T04 while it counts, T04a once rejected."""

    number: int
    attempt: int

    @property
    def kept(self) -> str:
        """Name of the file in trials/."""
        return f"T{self.number:02d}"

    @property
    def rejected(self) -> str:
        """Name of the file in rejected/."""
        letters = ""
        rest = self.attempt
        while rest > 0:
            rest, digit = divmod(rest - 1, 26)
            letters = chr(ord("a") + digit) + letters
        return self.kept + letters


@dataclass(slots=True)
class TrialOutcome:
    """How a recording ended.

    Attributes:
        reason: "travel", "key", "time-limit", "interrupted" or a fault's name.
        seconds: since the start [s].
        displacement: of the foot along the container [m].
    """

    reason: str
    seconds: float = 0.0
    displacement: float = 0.0

    @property
    def status(self) -> str:
        """The program's grade of the trial, never a verdict."""
        return "complete" if self.reason in COMPLETE else "interrupted"


def sidecar_of(
    name: TrialName, verified: VerifiedFile | None, outcome: TrialOutcome
) -> dict[str, object]:
    """Return the sidecar of an attempt without a verdict; no file where None."""
    return {
        "trial": name.kept,
        "attempt": name.attempt,
        "sha256": verified.sha256 if verified else "",
        "size": verified.size if verified else 0,
        "cycles": verified.cycles if verified else 0,
        "duration": round(verified.duration, 3) if verified else 0.0,
        "worst_gap": round(verified.worst_gap, 6) if verified else 0.0,
        "status": outcome.status,
        "stop_reason": outcome.reason,
        "displacement": round(outcome.displacement, 4),
        "verdict": "",
        "reason": "",
        "who": "",
        "when": "",
        "history": [],
    }
