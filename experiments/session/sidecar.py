"""An attempt at a trial: its name, its entries in the journal, and its sidecar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from acquisition.trial_file.verify import VerifiedFile

KEEP, REJECT = "keep", "reject"
TIME_LIMIT = 30.0  # s, longest trial
COMPLETE = frozenset({"travel", "key", "time-limit"})
_SUMS = {"sha256": str, "size": int}


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
        number = self.attempt
        while number > 0:
            number, digit = divmod(number - 1, 26)
            letters = chr(ord("a") + digit) + letters
        return self.kept + letters


@dataclass(slots=True)
class TrialOutcome:
    """End of a recording.

    Attributes:
        reason: "travel", "key", "time-limit", "interrupted" or a fault's name.
        seconds: time since the start [s].
        displacement: displacement of the foot along the container [m].
    """

    reason: str
    seconds: float = 0.0
    displacement: float = 0.0

    @property
    def status(self) -> str:
        """Automatic grade of the trial; a verdict is the operator's."""
        return "complete" if self.reason in COMPLETE else "interrupted"


def recording_of(
    verified: VerifiedFile | None, outcome: TrialOutcome
) -> dict[str, object]:
    """Return the figures of a recording for the journal; None = no file."""
    return {
        "sha256": verified.sha256 if verified else "",
        "size": verified.size if verified else 0,
        "cycles": verified.cycles if verified else 0,
        "duration": round(verified.duration, 3) if verified else 0.0,
        "worst_gap": round(verified.worst_gap, 6) if verified else 0.0,
        "status": outcome.status,
        "stop_reason": outcome.reason,
        "displacement": round(outcome.displacement, 4),
    }


@dataclass(frozen=True, slots=True)
class Verdict:
    """A verdict on an attempt.

    Attributes:
        verdict: "keep" or "reject"; "" before the first.
        reason: reason; may be empty for "keep".
        who: author.
        when: UTC as text.
    """

    verdict: str = ""
    reason: str = ""
    who: str = ""
    when: str = ""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One attempt at a trial, as the journal has it.

    Attributes:
        name: number and attempt.
        is_recorded: whether its recording was completed and verified.
        recording: figures of the recording and of its review; empty in journals that
            left them to the sidecar.
        sums: checksum and size as of the newest event that kept it.
        verdicts: all verdicts, oldest first.
        notes: remarks: `text`, `who` and `when`.
        next_tare: the following tare: `t_ns`, its host time [ns], and `bias`, the
            reading without load [N, N m]; empty before.
    """

    name: TrialName
    is_recorded: bool = False
    recording: Mapping[str, object] = field(default_factory=dict[str, object])
    sums: Mapping[str, object] = field(default_factory=dict[str, object])
    verdicts: tuple[Verdict, ...] = ()
    notes: tuple[Mapping[str, object], ...] = ()
    next_tare: Mapping[str, object] = field(default_factory=dict[str, object])

    @property
    def verdict(self) -> Verdict:
        """The newest verdict."""
        return self.verdicts[-1] if self.verdicts else Verdict()

    @property
    def is_rejected(self) -> bool:
        """Whether its files belong in rejected/."""
        return self.verdict.verdict == REJECT

    @property
    def stem(self) -> str:
        """Name of its files without suffix: "T04"."""
        return self.name.rejected if self.is_rejected else self.name.kept

    @property
    def relative_stem(self) -> str:
        """`stem` with the folder: "trials/T04"."""
        return f"{'rejected' if self.is_rejected else 'trials'}/{self.stem}"

    @property
    def sha256(self) -> str:
        """Checksum of the recording; empty if the journal states none."""
        return str({**self.recording, **self.sums}.get("sha256", ""))

    @property
    def size(self) -> object:
        """Size of the recording [bytes]; None if the journal states none."""
        return {**self.recording, **self.sums}.get("size")

    def with_verdict(self, verdict: Verdict) -> Attempt:
        """Return the attempt with a new verdict; an equal one changes nothing."""
        if verdict == self.verdict:
            return self
        return replace(self, verdicts=(*self.verdicts, verdict))

    def sidecar(self, other: Mapping[str, object]) -> dict[str, object]:
        """Return the content of the sidecar.

        Args:
            other: figures of the recording from its files, used if the journal
                states none.
        """
        fields = {
            **(self.recording or other),
            **self.sums,
            "trial": self.name.kept,
            "attempt": self.name.attempt,
            **asdict(self.verdict),
            "history": [asdict(verdict) for verdict in self.verdicts[:-1]],
        }
        if self.notes:
            fields["notes"] = [dict(note) for note in self.notes]
        if self.next_tare:
            fields["next_tare"] = dict(self.next_tare)
        return fields


def checksum_and_size(fields: Mapping[str, object]) -> dict[str, object]:
    """Return checksum and size of a recording, as far as `fields` state them."""
    return {key: fields[key] for key in _SUMS if type(fields.get(key)) is _SUMS[key]}
