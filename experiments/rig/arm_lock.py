"""One program per arm and host: a file lock, released when its owner dies.

There is one file per interface and channel, in a folder that every user may write to.
It is never removed, so that all programs lock the same file. Only the lock of the
Linux kernel is trusted: the content merely names the owner.
"""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import stat
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast
from urllib.parse import quote

from acquisition.clock import NS_PER_S, SystemClock
from acquisition.errors import PreflightError
from acquisition.files import UNFOLLOWED
from experiments.messages import preflight_error

FOLDERS = (Path("/run/lock"), Path("/var/lock"), Path("/var/tmp"), Path("/tmp"))
_SHARED = stat.S_ISVTX | stat.S_IWOTH  # all may write, only owners remove
_MODE = 0o666  # any user may be the next owner
_LONGEST_NAME = 200
_LONGEST_COMMAND = 120
_MOST_BYTES = 1024
_TRIES = 5


@dataclass(frozen=True, slots=True)
class ArmOwner:
    """Owner of an arm, as written by its process; "?" = unknown.

    Attributes:
        pid: process id.
        command: its command line.
        since: date and time [UTC] at which it took the arm.
    """

    pid: str = "?"
    command: str = "another program"
    since: str = "?"


class ArmLock:
    """Exclusive right to open the bus of an arm, until `close` or the owner's death."""

    def __init__(
        self, interface: str, channel: str, folders: Sequence[Path] = FOLDERS
    ) -> None:
        """Take the lock; the bus must not be open yet.

        Args:
            interface: python-can's name of the adapter.
            channel: the adapter's name, or the path of a served bus.
            folders: candidates for the folder of the lock file, see `lock_folder`.

        Raises:
            PreflightError: another process has the arm, or the file cannot be used.
        """
        import fcntl  # not on Windows; only Linux drives an arm

        self.path = lock_folder(folders) / lock_name(interface, channel)
        self._descriptor = _open_safely(self.path)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = _read_owner(self._descriptor)
            self.close()
            raise preflight_error(
                "arm-busy",
                bus=f"{interface}:{channel}",
                pid=owner.pid,
                command=owner.command,
                since=owner.since,
            ) from None
        except OSError as error:
            self.close()
            raise _unusable(self.path, error.strerror or str(error)) from error
        _write_owner(self._descriptor)

    def close(self) -> None:
        """Release the lock; safe to repeat."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def lock_folder(folders: Sequence[Path] = FOLDERS) -> Path:
    """Return the first of `folders` that all users may write to.

    Raises:
        PreflightError: there is none.
    """
    for folder in folders:
        try:
            mode = folder.stat().st_mode
        except OSError:
            continue
        if stat.S_ISDIR(mode) and mode & _SHARED == _SHARED:
            return folder
    names = ", ".join(map(str, folders))
    raise preflight_error(
        "arm-lock", detail=f"No folder for locks is open to all users: {names}."
    )


def lock_name(interface: str, channel: str) -> str:
    """Return the name of the lock file; symbolic links in a path are resolved."""
    if interface == "traction-fake" or "/" in channel:
        channel = os.path.realpath(channel)
    name = quote(f"{interface}:{channel}", safe="")
    if len(name) > _LONGEST_NAME:
        name = hashlib.sha256(name.encode()).hexdigest()
    return f"traction-{name}.lock"


def _open_safely(path: Path) -> int:
    """Open the lock file, creating it if needed; returns its descriptor.

    An existing file may belong to any user: only a regular file with a single hard link
    is accepted; links are not followed and the call does not block.
    """
    try:
        descriptor = _open_or_create(path)
    except OSError as error:
        raise _unusable(path, error.strerror or str(error)) from error
    fields = os.fstat(descriptor)
    if not stat.S_ISREG(fields.st_mode) or fields.st_nlink != 1:
        os.close(descriptor)
        raise _unusable(path, "it is not a regular file with a single link")
    return descriptor


def _open_or_create(path: Path) -> int:
    for _ in range(_TRIES):
        try:
            return os.open(path, os.O_RDWR | UNFOLLOWED)
        except FileNotFoundError:
            pass
        except PermissionError:
            return os.open(path, os.O_RDONLY | UNFOLLOWED)  # enough for the lock
        try:
            new = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | UNFOLLOWED, _MODE)
        except FileExistsError:
            continue  # another program was faster
        os.fchmod(new, _MODE)  # regardless of the umask
        return new
    raise OSError("another program keeps creating and removing it")


def _write_owner(descriptor: int) -> None:
    """Write the owner; failure is harmless: another user's file is locked anyway."""
    now = datetime.fromtimestamp(SystemClock().utc_ns() // NS_PER_S, UTC)
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    fields = {
        "pid": os.getpid(),
        "command": command[:_LONGEST_COMMAND],
        "since": f"{now:%Y-%m-%d %H:%M:%S} UTC",
    }
    try:
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps(fields).encode(), 0)
    except OSError:
        return


def _read_owner(descriptor: int) -> ArmOwner:
    """Return the owner as written, printable characters only."""
    try:
        fields: object = json.loads(os.pread(descriptor, _MOST_BYTES, 0))
    except (OSError, ValueError, RecursionError):
        return ArmOwner()
    if not isinstance(fields, dict):
        return ArmOwner()
    holder = cast("dict[str, object]", fields)
    names = {"pid", "command", "since"}
    return ArmOwner(
        **{name: _printable(str(holder[name])) for name in names & holder.keys()}
    )


def _printable(text: str) -> str:
    return "".join(c for c in text if c.isprintable())[:_LONGEST_COMMAND]


def _unusable(path: Path, why: str) -> PreflightError:
    return preflight_error(
        "arm-lock", detail=f"{path} cannot be the arm's lock: {why}."
    )
