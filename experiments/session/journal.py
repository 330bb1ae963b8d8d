"""The journal of a session: its events, the state they give, session.json."""

from dataclasses import dataclass, field

from acquisition.clock import Clock
from acquisition.errors import SessionError
from experiments.session.data_files import read_json, write_json
from experiments.session.reducer import KEEP, SessionState, apply, refusal, replay
from experiments.session.store import SUMMARY_FILE, SessionFolder, iso_utc
from experiments.session.trial_files import (
    decision_of,
    find_sidecar,
    move_trial_files,
    recorded_sum,
)


@dataclass(slots=True)
class Journal:
    """Writes every event to the journal first; state and files follow from it.

    Attributes:
        folder: the session on the disk.
        clock: of the times of the events.
        state: what the events give.
    """

    folder: SessionFolder
    clock: Clock
    state: SessionState = field(default_factory=SessionState)

    def append(self, event: str, **details: object) -> None:
        """Append an event of now, apply it, and replace session.json.

        Files of a trial move when the event is a verdict on it; one that keeps it has
        the checksum and size of its file.

        Raises:
            SessionError: the event cannot happen in this state.
            TrialFileError: the disk is full or gone.
        """
        utc = iso_utc(self.clock.utc_ns())
        entry: dict[str, object] = {"event": event, "utc": utc, **details}
        reason = refusal(self.state, entry)
        if reason:
            raise SessionError(f"{self.folder.id}: {event} is refused, {reason}.")
        verdict = decision_of(entry)
        if verdict is not None and verdict.verdict == KEEP:
            entry |= recorded_sum(find_sidecar(self.folder, verdict.name))
        lines = self.folder.append_event(entry)
        self.state = apply(self.state, entry)
        if verdict is not None:
            move_trial_files(self.folder, verdict)
        self._write_summary(details, lines)

    def saved(self) -> str:
        """Return what is safe on the disk, for a message."""
        kept = len(self.state.kept)
        trials = "1 trial is" if kept == 1 else f"{kept} trials are"
        return f"{trials} safe in {self.folder.path}."

    def _write_summary(self, details: dict[str, object], lines: int) -> None:
        path = self.folder.path / SUMMARY_FILE
        operator = details.get("operator", read_json(path).get("operator", ""))
        summary: dict[str, object] = {
            "id": self.folder.id,
            "phase": str(self.state.phase),
            "terrain": self.state.terrain,
            "simulated": self.folder.is_simulated,
            "operator": operator,
            "trials": self.state.wanted,
            "kept": [f"T{number:02d}" for number in self.state.kept],
            "rejected": self.state.rejected,
            "ended": self.state.ended,
            "events": lines,
            "force_drift": list(self.state.drift) or None,
        }
        write_json(path, summary)


def open_journal(folder: SessionFolder, clock: Clock) -> Journal:
    """Return the journal of a session that is on the disk already."""
    return Journal(folder, clock, replay(folder.events()))
