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
_ALMOST_NOTHING = 2_100_000_000  # bytes free, less than any session is allowed
_ROOM = 4096  # bytes that a full disk still takes of a running trial


class InjectedBugError(Exception):
    """A bug that was asked for."""


@dataclass(slots=True)
class HostFaults:
    """Injects faults of the computer; `restore` ends them all.

    Attributes:
        rig: whose recorder is hit.
    """

    rig: Rig
    _folder: SessionFolder | None = field(default=None, init=False)
    _is_locked: bool = field(default=False, init=False)
    _is_disk_full: bool = field(default=False, init=False)
    _restore: ExitStack = field(default_factory=ExitStack, init=False)

    def inject(self, name: str, trial: int) -> None:
        """Inject a fault while `trial` is recorded, or before the preflight (0)."""
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
        """End what has not ended by itself; safe to repeat."""
        self._restore.close()

    def free_bytes(self, folder: Path) -> int:
        """Return how much room is left where `folder` is [bytes]; a `DiskProbe`."""
        return _ALMOST_NOTHING if self._is_disk_full else free_bytes(folder)

    def enter_session(self, folder: SessionFolder) -> None:
        """Let faults hit the files of the session in `folder` from here on."""
        self._folder = folder

    def hold_lock(self, folder: SessionFolder) -> None:
        """Hold the lock of a new session, as another process would, if planned."""
        if self._is_locked:
            self._restore.enter_context(_occupied(folder.path / LOCK_FILE))

    def _partial(self, trial: int) -> Path:
        assert self._folder is not None
        return self._folder.trials / f"T{trial:02d}.mcap.partial"


@contextmanager
def _occupied(path: Path) -> Generator[None]:
    """Hold a lock through a description of its own: a lock belongs to the open file."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        wait_for_lock(descriptor)
        sign(descriptor)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def _full_disk(rig: Rig, path: Path) -> Generator[None]:
    """Let no file of the process that records grow beyond what `path` has now.

    The kernel then refuses to write, as it does on a full disk. Journal and sidecars
    are far smaller and stay writable, as the last blocks of a disk often are.
    """
    number = rig.backend.recorder_pid
    before = resource.prlimit(number, resource.RLIMIT_FSIZE)
    size = path.stat().st_size + _ROOM
    limits = (size, before[1])
    resource.prlimit(number, resource.RLIMIT_FSIZE, limits)
    try:
        yield
    finally:
        _quietly(lambda: resource.prlimit(number, resource.RLIMIT_FSIZE, before))


def _quietly(action: Callable[[], object]) -> None:
    """Do something to a process that may have gone."""
    try:
        action()
    except ProcessLookupError:
        return


def _flip_a_bit(path: Path) -> None:
    """Change one bit in the middle of what the disk has of a running trial."""
    with path.open("r+b") as file:
        offset = path.stat().st_size // 2
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes((byte ^ 0x10,)))
