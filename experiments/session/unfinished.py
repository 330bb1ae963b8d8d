"""Sessions that are not finished: left on purpose, or by a process that was killed."""

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
        state: what its journal says; a crash is a phase of its own here.
        seconds: sound recording in the file of a trial that was cut short [s], with
            what was recorded before the trigger; None without such a file.
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
        """Name of the trial that has no verdict; empty between trials."""
        number = self.state.running
        return "" if number is None else TrialName(number, 1).kept

    def metadata(self) -> dict[str, object]:
        """Return what messages say about it."""
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
        """Return what there is to say about it, without what to do."""
        name = "crash" if self.is_crashed else "unfinished"
        return CATALOGUE[name].what.format_map(self.metadata())


def find_unfinished(data: Path) -> list[UnfinishedSession]:
    """Return the sessions below `data` that can be resumed and are not open now.

    Folders that cannot be read are left out: a look at old sessions stops no new one.
    """
    sessions: list[UnfinishedSession] = []
    with suppress(OSError):
        for folder in list_sessions(data):
            with suppress(OSError, TrialFileError):
                unfinished = inspect_session(folder)
                sessions += [unfinished] if unfinished is not None else []
    return sessions


def is_unfinished(state: SessionState) -> bool:
    """Return whether something is left to be recorded, or to be put away."""
    return state.phase in OPEN | RESUMABLE


def inspect_session(folder: SessionFolder) -> UnfinishedSession | None:
    """Return the session as one to be resumed, None where it is not."""
    state = replay(folder.events())
    if not is_unfinished(state) or owner_of(folder) is not None:
        return None
    return UnfinishedSession(folder, state, _seconds(folder, state))


def _seconds(folder: SessionFolder, state: SessionState) -> float | None:
    """Return what there is of a trial that was cut short [s], None for nothing.

    The recorder ends the file of a console that was killed: it has its final name
    then, and the journal does not say that it was recorded.
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
