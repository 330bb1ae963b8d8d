"""One process per session: a file lock, released when its owner dies."""

import json
import os
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.errors import SessionError
from acquisition.locks import try_lock
from acquisition.trial_file.data_files import check_absent, check_folders, open_data
from experiments.session.data_files import read_json
from experiments.session.store import SessionFolder, iso_utc

LOCK_FILE = ".lock"
_TRIES = 5  # readers hold the lock briefly
_PAUSE_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class LockOwner:
    """The living process that has a session open.

    Attributes:
        pid: process id, 0 if not written yet.
        since: date and time [UTC] at which it opened the session.
    """

    pid: int
    since: str


@contextmanager
def session_lock(folder: SessionFolder) -> Generator[None]:
    """Lock the session against other processes; a kill releases the lock too.

    Raises:
        SessionError: a living process has it open, or the folder cannot be written.
        TrialFileError: the lock or a folder is a link out of the session.
    """
    try:
        check_folders(folder.path)
        descriptor = open_data(folder.path / LOCK_FILE, os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise SessionError(
            f"{folder.path} cannot be written ({error.strerror}).",
            hint="Is it on a read-only disk? Nothing was changed.",
        ) from error
    try:
        if not _take(descriptor):
            raise locked_error(folder)
        sign(descriptor)
        yield
    finally:
        os.close(descriptor)


def owner_of(folder: SessionFolder) -> LockOwner | None:
    """Return the living process that has the session open, or None.

    Raises:
        TrialFileError: the lock is a link out of the session, or cannot be opened.
    """
    path = folder.path / LOCK_FILE
    try:
        descriptor = open_data(path)
    except OSError as error:
        check_absent(path, error)
        return None
    try:
        is_free = try_lock(descriptor, is_shared=True)
    finally:
        os.close(descriptor)
    return None if is_free else _signature(path)


def locked_error(folder: SessionFolder) -> SessionError:
    """Return the error for a session that another process has open."""
    from experiments.messages import CATALOGUE

    owner = _signature(folder.path / LOCK_FILE)
    message = CATALOGUE["locked"]
    fields = {
        "session": folder.id,
        "pid": owner.pid or "?",
        "since": owner.since or "?",
    }
    return SessionError(message.what.format_map(fields), hint=message.do)


def _take(descriptor: int) -> bool:
    clock = SystemClock()
    for _ in range(_TRIES):
        if try_lock(descriptor):
            return True
        clock.sleep_until(clock.now_ns() + _PAUSE_NS)
    return False


def sign(descriptor: int) -> None:
    """Write owner and time into an open lock file."""
    since = iso_utc(SystemClock().utc_ns())
    text = json.dumps({"pid": os.getpid(), "since": since}).encode()
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, text, 0)


def _signature(path: Path) -> LockOwner:
    fields = read_json(path)
    pid, since = fields.get("pid"), str(fields.get("since", ""))
    return LockOwner(pid if type(pid) is int else 0, since[11:16])
