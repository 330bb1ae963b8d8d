"""Temporary folders that are cleaned up even after a kill.

A folder has its process id in its name and is locked while in use. Creating a folder
removes those of the same user whose process has ended.
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
    """Create a folder PREFIX-PID-... in `parent`, yield it, and remove it at the end.

    Raises:
        OSError: the folder cannot be created.
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
    """Remove the folders PREFIX-PID-... in `parent` left by killed processes.

    Folders of other users or running processes are kept.
    """
    with suppress(OSError):
        for path in parent.glob(f"{prefix}-*-*"):
            match = _PID.match(path.name.removeprefix(prefix))
            if match and not _is_running(int(match["pid"])):
                _remove(path)


def _is_running(pid: int) -> bool:
    """Return whether another process with this id runs; False for zombies."""
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
    """Remove a folder of this user that is not locked."""
    try:
        descriptor = os.open(path, FOLDER | NO_LINK)
    except OSError:
        return
    try:
        is_own = os.fstat(descriptor).st_uid == os.getuid()
        # A locked folder is in use, e.g. by a process of another container. Without
        # file locks this is unknown, so the folder is kept.
        if is_own and try_lock(descriptor, without=False):
            shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(descriptor)
