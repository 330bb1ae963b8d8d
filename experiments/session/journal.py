"""The session's book: journal, state that follows from it, session.json."""

from collections.abc import Callable
from dataclasses import dataclass, field

from acquisition.clock import Clock
from acquisition.errors import SessionError
from experiments.session.reducer import SessionState, apply, refusal, replay
from experiments.session.store import SessionFolder, iso_utc, read_json, write_json
from experiments.session.trial_files import decision_of, move_trial_files


def at_once(work: Callable[[], None]) -> None:
    """Do `work` here and now."""
    work()


@dataclass(slots=True)
class Journal:
    """Writes every event to the journal first; state and files follow from it.

    Attributes:
        folder: the session on the disk.
        clock: whose time the events carry.
        state: what the journal says.
        aside: how the disk is written to; a slow one may not keep the console from
            looking after the arm.
    """

    folder: SessionFolder
    clock: Clock
    state: SessionState = field(default_factory=SessionState)
    aside: Callable[[Callable[[], None]], None] = at_once

    def note(self, event: str, **facts: object) -> None:
        """Append an event of now, apply it, and replace session.json.

        Files of a trial move when the event is a verdict on it.

        Raises:
            SessionError: the event cannot happen in this state.
            TrialFileError: the disk is full or gone.
        """
        utc = iso_utc(self.clock.utc_ns())
        entry: dict[str, object] = {"event": event, "utc": utc, **facts}
        reason = refusal(self.state, entry)
        if reason:
            raise SessionError(f"{self.folder.id}: {event} is refused, {reason}.")
        self.aside(lambda: self._write(entry, facts))

    def _write(self, entry: dict[str, object], facts: dict[str, object]) -> None:
        self.folder.append_event(entry)
        self.state = apply(self.state, entry)
        decision = decision_of(entry)
        if decision is not None:
            move_trial_files(self.folder, decision)
        self._write_summary(facts)

    def saved(self) -> str:
        """Return what is safe on the disk, for a message."""
        kept = len(self.state.kept)
        trials = "1 trial is" if kept == 1 else f"{kept} trials are"
        return f"{trials} safe in {self.folder.path}."

    def _write_summary(self, facts: dict[str, object]) -> None:
        path = self.folder.path / "session.json"
        operator = facts.get("operator", read_json(path).get("operator", ""))
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
            "force_drift": list(self.state.drift) or None,
        }
        write_json(path, summary)


def open_journal(folder: SessionFolder, clock: Clock) -> Journal:
    """Return the book of a session that is on the disk already."""
    return Journal(folder, clock, replay(folder.events()))
