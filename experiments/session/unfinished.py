"""Sessions that are not finished: left on purpose, or by a process that was killed."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from acquisition import TrialFileError
from acquisition.trial_file import is_there, read_file, recorded_seconds
from experiments.messages import CATALOGUE
from experiments.session.lock import owner_of
from experiments.session.reducer import SessionState, replay
from experiments.session.states import OPEN, RESUMABLE, SessionPhase
from experiments.session.store import SessionFolder, list_sessions
from experiments.session.trial_name import TrialName


@dataclass(frozen=True, slots=True)
class UnfinishedSession:
    """A session that can be resumed.

    Attributes:
        folder: the session on the disk.
        state: what its journal says; a crash is a phase of its own here.
        seconds: sound recording in the `.partial` of the trial that has no verdict
            [s], with what was recorded before the trigger; None without such a file.
        last_utc: time of the last event, as the journal has it.
    """

    folder: SessionFolder
    state: SessionState
    seconds: float | None
    last_utc: str

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


def inspect_session(folder: SessionFolder) -> UnfinishedSession | None:
    """Return the session as one to be resumed, None where it is not."""
    events = folder.events()
    state = replay(events)
    if state.phase not in OPEN | RESUMABLE or owner_of(folder) is not None:
        return None
    partial = folder.trials / f"T{state.running or 0:02d}.mcap.partial"
    return UnfinishedSession(
        folder, state, _seconds(partial), str(events[-1].get("utc") or "")
    )


def _seconds(partial: Path) -> float | None:
    try:
        if not is_there(partial):
            return None
        return recorded_seconds(read_file(partial))
    except TrialFileError:
        return None
