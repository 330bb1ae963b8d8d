"""The session's book: journal, state that follows from it, session.json."""

from dataclasses import dataclass, field

from experiments.rigs import Rig
from experiments.session import SessionState, apply
from experiments.store import iso_utc, write_json
from experiments.trial import SessionFacts


@dataclass(slots=True)
class Book:
    """Writes every event to the journal first and derives the state from it."""

    rig: Rig
    facts: SessionFacts
    state: SessionState = field(default_factory=SessionState)

    def note(self, event: str, **facts: object) -> None:
        """Append an event of now, apply it, and replace session.json."""
        utc = iso_utc(self.rig.clock.utc_ns())
        entry: dict[str, object] = {"event": event, "utc": utc, **facts}
        self.facts.folder.append_event(entry)
        self.state = apply(self.state, entry)
        write_json(self.facts.folder.path / "session.json", self._summary())

    def saved(self) -> str:
        """Return what is safe on the disk, for a message."""
        kept = len(self.state.kept)
        trials = "1 trial is" if kept == 1 else f"{kept} trials are"
        return f"{trials} safe in {self.facts.folder.path}."

    def _summary(self) -> dict[str, object]:
        return {
            "id": self.facts.folder.id,
            "terrain": self.state.terrain,
            "simulated": self.rig.is_simulated,
            "operator": self.facts.operator,
            "trials": self.state.wanted,
            "kept": [f"T{number:02d}" for number in self.state.kept],
            "rejected": self.state.rejected,
            "ended": self.state.ended,
        }
