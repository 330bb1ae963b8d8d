"""Temporary folders that a kill does not leave behind for good.

A folder carries the number of its process in its name and is locked while it is used.
Whoever makes the next one removes those of the same user whose process is gone.
"""

import os
import re
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from acquisition.files import FOLDER, NO_LINK
from acquisition.locks import try_lock

_PID = re.compile(r"-(?P<pid>[1-9]\d{0,9})-\w+$")


@contextmanager
def temporary_folder(prefix: str, parent: Path) -> Generator[Path]:
    """Give a new folder PREFIX-PID-... in `parent`; at the end it is removed.

    Raises:
        OSError: it cannot be made.
    """
    remove_abandoned(prefix, parent)
    path = Path(tempfile.mkdtemp(prefix=f"{prefix}-{os.getpid()}-", dir=parent))
    descriptor = os.open(path, FOLDER | NO_LINK)
    try:
        try_lock(descriptor)
        yield path
    finally:
        os.close(descriptor)
        shutil.rmtree(path, ignore_errors=True)


def remove_abandoned(prefix: str, parent: Path) -> None:
    """Remove the folders PREFIX-PID-... in `parent` that a killed process left.

    Folders of other users, and of processes that run, stay; so do other files.
    """
    with suppress(OSError):
        for path in parent.glob(f"{prefix}-*-*"):
            match = _PID.match(path.name.removeprefix(prefix))
            if match and not _is_running(int(match["pid"])):
                _remove(path)


def _is_running(pid: int) -> bool:
    """Return whether another process has this number; this one knows its own.

    One that has ended and was not yet collected by its parent runs no more.
    """
    if pid == os.getpid():
        return False
    try:
        os.kill(pid, 0)
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except (ProcessLookupError, FileNotFoundError):
        return False
    except (OSError, OverflowError):
        return True
    return not stat.rpartition(")")[2].strip().startswith(("Z", "X"))


def _remove(path: Path) -> None:
    """Remove a folder of this user that nobody has locked."""
    try:
        descriptor = os.open(path, FOLDER | NO_LINK)
    except OSError:
        return
    try:
        is_own = os.fstat(descriptor).st_uid == os.getuid()
        # What is locked is in use, e.g. by a process of another container; without
        # locks nobody can tell.
        if is_own and try_lock(descriptor, without=False):
            shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(descriptor)
