"""Unfinished sessions: closed before their end, or left by a killed process."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TrialFileError
from acquisition.trial_file.contents import read_file
from acquisition.trial_file.data_files import is_there
from acquisition.trial_file.salvage import recorded_seconds
from experiments.messages import CATALOGUE
from experiments.session.lock import owner_of
from experiments.session.reducer import SessionState, replay
from experiments.session.sidecar import TrialName
from experiments.session.states import OPEN, RESUMABLE, SessionPhase
from experiments.session.store import SessionFolder, list_sessions


@dataclass(frozen=True, slots=True)
class UnfinishedSession:
    """A session that can be resumed.

    Attributes:
        folder: the session on the disk.
        state: state after its journal.
        seconds: valid recording of an interrupted trial [s], including the time before
            the trigger; None without such a file.
    """

    folder: SessionFolder
    state: SessionState
    seconds: float | None

    @property
    def is_crashed(self) -> bool:
        """Whether it ended without closing."""
        return self.state.phase in OPEN | {SessionPhase.CRASHED}

    @property
    def running(self) -> str:
        """Name of the trial without a verdict; empty between trials."""
        number = self.state.running
        return "" if number is None else TrialName(number, 1).kept

    def metadata(self) -> dict[str, object]:
        """Fields of messages about the session."""
        where = "between trials"
        if self.running and self.seconds is None:
            where = f"{self.running} before its verdict"
        elif self.running:
            where = f"{self.running} at {self.seconds:.1f} s"
        redone = f" - {self.running} will be redone, its data are in rejected/"
        return {
            "session": self.folder.id,
            "terrain": self.folder.terrain,
            "kept": len(self.state.kept),
            "wanted": self.state.wanted,
            "where": where,
            "redone": redone if self.running else "",
        }

    def text(self) -> str:
        """Message about the session, without advice."""
        name = "crash" if self.is_crashed else "unfinished"
        return CATALOGUE[name].what.format_map(self.metadata())


def find_unfinished(data: Path) -> list[UnfinishedSession]:
    """Return the sessions below `data` that can be resumed and are not open.

    Unreadable folders are skipped: an old session never prevents a new one.
    """
    sessions: list[UnfinishedSession] = []
    with suppress(OSError):
        for folder in list_sessions(data):
            with suppress(OSError, TrialFileError):
                unfinished = inspect_session(folder)
                sessions += [unfinished] if unfinished is not None else []
    return sessions


def is_unfinished(state: SessionState) -> bool:
    """Return whether trials or a verdict are outstanding."""
    return state.phase in OPEN | RESUMABLE


def inspect_session(folder: SessionFolder) -> UnfinishedSession | None:
    """Return the session if it can be resumed, else None."""
    state = replay(folder.events())
    if not is_unfinished(state) or owner_of(folder) is not None:
        return None
    return UnfinishedSession(folder, state, _recorded_seconds(folder, state))


def _recorded_seconds(folder: SessionFolder, state: SessionState) -> float | None:
    """Duration of the recording of an interrupted trial [s], or None.

    The recorder completes the file of a killed console: it then has its final name,
    while the journal lacks the event that it was recorded.
    """
    name = TrialName(state.running or 0, state.attempt(state.running or 0))
    path = folder.trials / f"{name.kept}.mcap.partial"
    try:
        if not is_there(path):
            path = path.with_suffix("")
        if not is_there(path) or state.attempt_at(name).is_recorded:
            return None
        return recorded_seconds(read_file(path))
    except TrialFileError:
        return None
