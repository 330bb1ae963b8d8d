"""Folders and files of sessions: numbered, written atomically, never overwritten."""

import os
import re
import shutil
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.errors import SessionError, SettingsError, TrialFileError
from acquisition.files import make_directories, sync_directory
from acquisition.locks import wait_for_lock
from acquisition.trial_file.data_files import (
    check_absent,
    check_folders,
    is_there,
    list_folder,
    open_data,
    read_data,
)
from experiments.session.data_files import (
    journal_line,
    journal_problem,
    parse_journal,
    sha256_of,
    writing,
)
from experiments.session.reducer import SessionState, replay
from experiments.session.sidecar import Attempt

JOURNAL_FILE = "events.jsonl"
SUMMARY_FILE = "session.json"  # written after each line of the journal
_PACKAGE = "datapackage.json"  # in a folder of tables
FOLDS = ".folds"  # in the data folder: finished folds, so that a study resumes
_FOLDER = re.compile(
    r"^(?P<date>\d{4}-\d\d-\d\d)_(?P<id>S\d{3,})_(?P<terrain>(?:[A-Za-z0-9+-]|\.\d)+)"
    r"(?P<fake>\.fake)?$"
)
LONGEST_NAME = 64
MAX_EVENTS = 50_000


@dataclass(frozen=True)
class JournalContent:
    """A journal as read from the disk.

    Attributes:
        text: its bytes, empty if there is none.
        events: its events, without torn lines and lines of a wrong checksum.
        faults: faults in its lines.
    """

    text: bytes
    events: list[dict[str, Any]]
    faults: list[str]

    @cached_property
    def state(self) -> SessionState:
        """The state of the session after its events."""
        return replay(self.events)


@dataclass(frozen=True, slots=True)
class SessionFolder:
    """One session on the disk.

    Attributes:
        path: its folder.
        id: such as "S012".
        terrain: name of the terrain.
        is_simulated: whether the folder ends in .fake.
    """

    path: Path
    id: str
    terrain: str
    is_simulated: bool

    @property
    def trials(self) -> Path:
        """Folder of the kept trials."""
        return self.path / "trials"

    @property
    def rejected(self) -> Path:
        """Folder of rejected and interrupted trials."""
        return self.path / "rejected"

    @property
    def faults(self) -> Path:
        """Folder of flight records."""
        return self.path / "faults"

    def append_event(self, event: Mapping[str, object]) -> int:
        """Append one line to the journal and sync it; returns its number.

        A torn last line is terminated first, so that it does not damage the new one.

        Raises:
            TrialFileError: the disk is full or unavailable.
        """
        path = self.path / JOURNAL_FILE
        with writing(path):
            descriptor = open_data(path, os.O_RDWR | os.O_APPEND | os.O_CREAT)
            with os.fdopen(descriptor, "r+b") as file:
                is_new = not file.seek(0, os.SEEK_END)
                if is_new:  # a new journal must not lose its name
                    sync_directory(self.path)
                file.seek(0)
                before = file.read()
                is_torn = bool(before) and not before.endswith(b"\n")
                number = before.count(b"\n") + is_torn + 1
                line = journal_line(event, number)
                file.write(b"\n" + line if is_torn else line)
                file.flush()
                os.fsync(descriptor)
        return number

    def journal_text(self) -> bytes:
        """Return the journal as bytes, empty if there is none.

        Raises:
            TrialFileError: the journal or a folder is a link out of the session; or it
                is too long.
        """
        check_folders(self.path)
        path = self.path / JOURNAL_FILE
        try:
            text = read_data(path)
        except OSError as error:
            check_absent(path, error)
            return b""
        if text.count(b"\n") > MAX_EVENTS:
            raise TrialFileError(path, f"has more than {MAX_EVENTS} lines")
        return text

    def journal(self) -> JournalContent:
        """Return the content of the journal.

        Raises:
            TrialFileError: as `journal_text`, or the journal has another version.
        """
        text = self.journal_text()
        if problem := journal_problem(text):
            raise TrialFileError(self.path / JOURNAL_FILE, problem)
        return JournalContent(text, *parse_journal(text))

    def events(self) -> list[dict[str, Any]]:
        """Return the events of the journal.

        Raises:
            TrialFileError: as `journal`.
        """
        return self.journal().events

    def kept_trials(self, digest: Callable[[Path], str] | None = None) -> list[Path]:
        """Return the files of the kept trials with the right checksum, in order.

        The journal decides. After a kill during a verdict the file may still be in
        rejected/.

        Args:
            digest: function that computes a checksum; None = `sha256_of`.
        """
        kept = self.journal().state.kept_trials
        files = (self.find_kept(attempt, digest or sha256_of) for attempt in kept)
        return [path for path in files if path is not None]

    def find_kept(self, kept: Attempt, digest: Callable[[Path], str]) -> Path | None:
        """Return the file of a kept trial; None if none has the right checksum."""
        name = kept.name
        at_trials = self.trials / f"{name.kept}.mcap"
        for path in (at_trials, self.rejected / f"{name.rejected}.mcap"):
            if kept.sha256 and is_there(path) and digest(path) == kept.sha256:
                return path
        return None


def list_sessions(data: Path) -> list[SessionFolder]:
    """Return all sessions below `data`, oldest number first.

    Raises:
        TrialFileError: the folder cannot be listed.
    """
    paths = list_folder(data / "sessions")
    matches = [_session_at(path) for path in paths if path.is_dir()]
    return sorted((s for s in matches if s), key=lambda s: (int(s.id[1:]), s.path.name))


def unnamed_sessions(data: Path) -> list[Path]:
    """Return folders with a journal whose name is not that of a session.

    Raises:
        TrialFileError: the folder cannot be listed.
    """
    return [
        path
        for path in list_folder(data / "sessions")
        if _session_at(path) is None and is_there(path / JOURNAL_FILE)
    ]


def find_session(data: Path, name: str) -> SessionFolder:
    """Return the session called `name`: an id, a folder name or a path.

    Raises:
        SessionError: no session matches, or several.
    """
    as_path = _session_at(Path(name))
    if as_path is not None and as_path.path.is_dir():
        return as_path
    matches = [s for s in list_sessions(data) if name in {s.id, s.path.name}]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise SessionError(
            f"{name} is the number of {len(matches)} sessions: "
            f"{', '.join(s.path.name for s in matches)}.",
            hint="Name the folder; give the copy another place.",
        )
    if os.path.isfile(name):  # noqa: PTH113 - no error for a name that no file can have
        raise SessionError(
            f"{name} is a file, not a session.",
            hint=_file_hint(Path(name)),
        )
    if os.path.isfile(os.path.join(name, _PACKAGE)):  # noqa: PTH113, PTH118 - as above
        raise SessionError(
            f"{name} is a folder of tables, not a session.",
            hint=f"traction fit {name}",
        )
    known = " ".join(s.id for s in list_sessions(data)) or "none yet"
    raise SessionError(
        f"There is no session {name!r} in {data / 'sessions'}.",
        hint=f"Sessions: {known}.",
    )


def _file_hint(path: Path) -> str:
    """Advice for a file given in place of a session."""
    session = _session_at(path.absolute().parent.parent)
    if session is not None and path.suffix == ".mcap":
        return f"Name its session: {session.id}; traction replay also takes the trial."
    if path.suffix == ".mcap":
        return "A trial is read where it was recorded, in the folder of its session."
    return "Tables are read by: traction fit FILE."


def create_session(
    data: Path, terrain: str, *, is_simulated: bool, utc_ns: int
) -> SessionFolder:
    """Create the folder of a new session with the next free number.

    Raises:
        SettingsError: `data` cannot be written.
    """
    sessions = data / "sessions"
    created: Path | None = None
    try:
        make_directories(sessions)
        with _locked(sessions / ".lock"):
            numbers = [int(s.id[1:]) for s in list_sessions(data)]
            number = max(numbers, default=0) + 1
            date = datetime.fromtimestamp(utc_ns * 1e-9, UTC).strftime("%Y-%m-%d")
            suffix = ".fake" if is_simulated else ""
            path = sessions / f"{date}_S{number:03d}_{terrain}{suffix}"
            path.mkdir()
            created = path
        for name in ("trials", "rejected", "faults"):
            (path / name).mkdir()
        sync_directory(path)
        sync_directory(sessions)
    except OSError as error:
        if created is not None:  # by this call; contains only folders
            shutil.rmtree(created, ignore_errors=True)
        raise SettingsError(
            f"{data} cannot be written ({error.strerror}).",
            hint="Name another folder with --data. Nothing was started.",
        ) from error
    return SessionFolder(path, f"S{number:03d}", terrain, is_simulated)


def _session_at(path: Path) -> SessionFolder | None:
    match = _FOLDER.match(path.name)
    if not match or len(path.name) > LONGEST_NAME:
        return None
    return SessionFolder(path, match["id"], match["terrain"], bool(match["fake"]))


@contextmanager
def _locked(path: Path) -> Generator[None, None, None]:
    descriptor = open_data(path, os.O_RDWR | os.O_CREAT)
    try:
        wait_for_lock(descriptor)
        yield
    finally:
        os.close(descriptor)


def session_utc_ns() -> int:
    """Return the machine's UTC [ns]: simulated sessions have the real date too."""
    return SystemClock().utc_ns()


def iso_utc(utc_ns: int) -> str:
    """Return UTC as text, e.g. 2027-03-14T10:14:05Z."""
    return datetime.fromtimestamp(utc_ns // 1_000_000_000, UTC).strftime(
        "%Y-%m-%dT%H:%M:%SZ"
    )
