"""Sessions that a killed process left behind: what they hold, what to do."""

import fcntl
import os
import shlex
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TrialFileError
from acquisition.trial_file.chunks import read_file
from acquisition.trial_file.recover import recovered_path
from acquisition.trial_file.salvage import recorded_seconds
from experiments.session import replay
from experiments.store import SessionFolder, list_sessions
from experiments.trial import TrialName


@dataclass(frozen=True, slots=True)
class Wreck:
    """A session whose journal does not end with its end.

    Attributes:
        folder: the session on the disk.
        kept: how many trials were kept.
        running: name of the trial that had no verdict yet; empty between trials.
        seconds: sound recording in that trial's `.partial` [s], with what was
            recorded before the trigger; None where there is no such file.
        partials: every `.partial` that has not been recovered yet.
        last_utc: time of the last event, as the journal has it.
    """

    folder: SessionFolder
    kept: int
    running: str
    seconds: float | None
    partials: tuple[Path, ...]
    last_utc: str

    def text(self) -> str:
        """Return the message for the operator."""
        where = "between trials"
        if self.running and self.seconds is None:
            where = f"{self.running} before its verdict"
        elif self.running:
            where = f"{self.running} at {self.seconds:.1f} s"
        said = f"{self.folder.id} ended without closing ({where}). {self.kept} kept."
        if not self.partials:
            return said
        what = self.partials[0] if len(self.partials) == 1 else self.folder.path
        return f"{said} To save the rest: traction recover {shlex.quote(str(what))}"


def find_wreckage(data: Path) -> list[Wreck]:
    """Return the sessions below `data` that were neither closed nor are open now.

    Folders that cannot be read are left out: a look at old sessions stops no new one.
    """
    found: list[Wreck] = []
    with suppress(OSError):
        for folder in list_sessions(data):
            with suppress(OSError):
                wreck = _look_at(folder)
                found += [wreck] if wreck is not None else []
    return found


@contextmanager
def held_open(folder: SessionFolder) -> Generator[None]:
    """Show other processes that the session is alive; a kill lets go of it too."""
    descriptor = os.open(folder.path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield
    finally:
        os.close(descriptor)


def _look_at(folder: SessionFolder) -> Wreck | None:
    events = folder.events()
    state = replay(events)
    if not state.terrain or state.ended or _is_open(folder):
        return None
    running = TrialName(state.running, 1).kept if state.running is not None else ""
    partials = sorted(folder.path.rglob("*.mcap.partial"))
    return Wreck(
        folder=folder,
        kept=len(state.kept),
        running=running,
        seconds=_seconds(folder.trials / f"{running}.mcap.partial"),
        partials=tuple(p for p in partials if not recovered_path(p).exists()),
        last_utc=str(events[-1].get("utc", "")),
    )


def _is_open(folder: SessionFolder) -> bool:
    """Return whether a living process holds the session open."""
    descriptor = os.open(folder.path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    finally:
        os.close(descriptor)
    return False


def _seconds(partial: Path) -> float | None:
    if not partial.is_file():
        return None
    try:
        return recorded_seconds(read_file(partial))
    except TrialFileError:
        return None
