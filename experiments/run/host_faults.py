"""Faults of the computer in a rehearsed session: disk, lock, kill, bug."""

import os
import resource
import signal
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from acquisition.locks import wait_for_lock
from experiments.preflight.host_checks import free_bytes
from experiments.rig.rig import Rig
from experiments.session.lock import LOCK_FILE, sign
from experiments.session.store import SessionFolder

COMPUTER_FAULTS = ("bug", "crash", "disk-full", "locked", "write-failed")
_TOO_FEW_BYTES = 2_100_000_000  # bytes, less than any session requires
_ROOM = 4096  # bytes of a running trial that still fit on a full disk


class InjectedBugError(Exception):
    """A planned bug."""


@dataclass(slots=True)
class HostFaults:
    """Injects faults of the computer; `restore` removes them.

    Attributes:
        rig: rig with the recorder that fails.
    """

    rig: Rig
    _folder: SessionFolder | None = field(default=None, init=False)
    _is_locked: bool = field(default=False, init=False)
    _is_disk_full: bool = field(default=False, init=False)
    _restore: ExitStack = field(default_factory=ExitStack, init=False)

    def inject(self, name: str, trial: int) -> None:
        """Inject a fault during `trial`, or before the preflight (0)."""
        if name == "crash":
            os.kill(os.getpid(), signal.SIGKILL)
        elif name == "locked":
            self._is_locked = True
        elif name == "disk-full" and trial == 0:
            self._is_disk_full = True
        elif name == "disk-full":
            self._restore.enter_context(_full_disk(self.rig, self._partial(trial)))
        elif name == "write-failed":
            _flip_a_bit(self._partial(trial))
        else:
            raise InjectedBugError("rehearsed")

    def restore(self) -> None:
        """Remove all faults; safe to repeat."""
        self._restore.close()

    def free_bytes(self, folder: Path) -> int:
        """Free space on the disk of `folder` [bytes]; a `DiskProbe`."""
        return _TOO_FEW_BYTES if self._is_disk_full else free_bytes(folder)

    def enter_session(self, folder: SessionFolder) -> None:
        """Set the session whose files the faults damage."""
        self._folder = folder

    def hold_lock(self, folder: SessionFolder) -> None:
        """Hold the lock of a new session as another process would, if planned."""
        if self._is_locked:
            self._restore.enter_context(_occupied(folder.path / LOCK_FILE))

    def _partial(self, trial: int) -> Path:
        assert self._folder is not None
        return self._folder.trials / f"T{trial:02d}.mcap.partial"


@contextmanager
def _occupied(path: Path) -> Generator[None]:
    """Hold a lock through a separate open file description, which owns it."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        wait_for_lock(descriptor)
        sign(descriptor)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _full_disk(rig: Rig, path: Path) -> Generator[None]:
    """Limit the file size of the recorder process to the present size of `path`.

    The kernel then refuses writes as on a full disk. Journal and sidecars are far
    smaller and stay writable, as the last blocks of a disk often do.
    """
    number = rig.backend.recorder_pid
    before = resource.prlimit(number, resource.RLIMIT_FSIZE)
    size = path.stat().st_size + _ROOM
    limits = (size, before[1])
    resource.prlimit(number, resource.RLIMIT_FSIZE, limits)
    try:
        yield
    finally:
        _ignore_ended_process(
            lambda: resource.prlimit(number, resource.RLIMIT_FSIZE, before)
        )


def _ignore_ended_process(action: Callable[[], object]) -> None:
    """Act on a process that may have ended."""
    try:
        action()
    except ProcessLookupError:
        return


def _flip_a_bit(path: Path) -> None:
    """Flip one bit in the middle of the file of a running trial."""
    with path.open("r+b") as file:
        offset = path.stat().st_size // 2
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes((byte ^ 0x10,)))
