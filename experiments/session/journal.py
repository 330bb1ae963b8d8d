"""The journal of a session: its events, and the state and files derived from them."""

from dataclasses import dataclass, field

from acquisition.clock import Clock
from acquisition.errors import SessionError, TrialFileError
from experiments.session.derivation import derive, sidecar_of
from experiments.session.reducer import SessionState, apply, refusal, replay
from experiments.session.sidecar import KEEP, checksum_and_size
from experiments.session.states import Event
from experiments.session.store import SessionFolder, iso_utc


@dataclass(slots=True)
class Journal:
    """Writes every event to the journal first; state and files follow from it.

    Attributes:
        folder: the session on the disk.
        clock: source of the times of events.
        state: state after all events.
    """

    folder: SessionFolder
    clock: Clock
    state: SessionState = field(default_factory=SessionState)

    def append(self, event: str, **details: object) -> None:
        """Append an event with the current time, apply it, and update the files.

        An event that keeps a trial contains the checksum and size of its file.

        Raises:
            SessionError: the event is not allowed in this state.
            TrialFileError: the disk is full or unavailable.
        """
        utc = iso_utc(self.clock.utc_ns())
        entry: dict[str, object] = {"event": event, "utc": utc, **details}
        reason = refusal(self.state, entry)
        if reason:
            raise SessionError(f"{self.folder.id}: {event} is refused: {reason}.")
        if event == Event.TRIAL_KEPT or details.get("verdict") == KEEP:
            entry |= self._checksum_and_size(entry)
        self.folder.append_event(entry)
        self.state = apply(self.state, entry)
        try:
            derive(self.folder, self.state)
        except TrialFileError as error:
            error.saved = "The journal has the entry: do not repeat it."
            raise

    def _checksum_and_size(self, entry: dict[str, object]) -> dict[str, object]:
        """Checksum and size of the trial that an event keeps; empty if none."""
        after, before = apply(self.state, entry).kept_trials, self.state.attempts
        sidecars = [
            sidecar_of(self.folder, kept) for kept in after if kept not in before
        ]
        return checksum_and_size(sidecars[0]) if sidecars else {}

    def saved_message(self) -> str:
        """Sentence that states how many trials are safe on disk, and where."""
        kept = len(self.state.kept)
        trials = "1 trial is" if kept == 1 else f"{kept} trials are"
        return f"{trials} safe in {self.folder.path}."


def open_journal(folder: SessionFolder, clock: Clock) -> Journal:
    """Return the journal of an existing session."""
    return Journal(folder, clock, replay(folder.events()))
