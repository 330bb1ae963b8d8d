"""Shared memory of processes: allocation, lookup, and the supported machines.

Ring buffers and latest-value slots have one writer and no locks: the payload is written
before the counter. Only x86 keeps the order of stores between processors; on others,
such as ARM, a counter may become visible before its record. Processes are refused
there; a rig in one thread is not affected.
"""

import mmap
import os
import platform
import tempfile
from contextlib import suppress
from pathlib import Path

from acquisition.errors import PreflightError

LINE = 64  # bytes of a cache line
ORDERED_MACHINES = frozenset({"x86_64", "AMD64", "i386", "i686"})
_STEPPED = "Simulations run here with --fake, without --processes."
_MEMORY_NAME = "traction"
_MEMORY_LINK = f"/memfd:{_MEMORY_NAME} (deleted)"  # link target in /proc/PID/fd


def lines(size: int) -> int:
    """Return `size` [bytes] rounded up to whole cache lines."""
    return -(-size // LINE) * LINE


def require_ordered_stores() -> None:
    """Refuse a system without memfd, or with weakly ordered stores.

    Raises:
        PreflightError: not Linux, or not x86.
    """
    if not hasattr(os, "memfd_create"):
        raise PreflightError(
            f"This system is {platform.system() or 'unknown'}: an arm, and processes "
            "that share memory, need Linux.",
            hint=_STEPPED,
            arm_state="not touched",
        )
    machine = platform.machine()
    if machine not in ORDERED_MACHINES:
        raise PreflightError(
            f"This machine is {machine or 'unknown'}: processes that share memory need "
            "an x86 (64 or 32 bit), which keeps the order of stores.",
            hint=f"Use an x86 machine. {_STEPPED}",
            arm_state="not touched",
        )


def _anonymous_file() -> int:
    """Return the descriptor of an empty anonymous file."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create(_MEMORY_NAME, os.MFD_CLOEXEC)
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


class SharedMemory:
    """A mapped anonymous file in memory, freed with its last user.

    A child inherits the descriptor; without a name nothing is left in /dev/shm even if
    every process is killed.

    Attributes:
        descriptor: descriptor of the file, to be inherited by a child.
        view: the memory; read-only if of another process.
    """

    def __init__(self, descriptor: int, *, is_writable: bool = True) -> None:
        """Map the file of `descriptor` and take ownership of it."""
        self.descriptor = descriptor
        access = mmap.ACCESS_WRITE if is_writable else mmap.ACCESS_READ
        size = os.fstat(descriptor).st_size
        self._map = mmap.mmap(descriptor, size, access=access)
        self.view = memoryview(self._map)

    @classmethod
    def create(cls, size: int) -> "SharedMemory":
        """Return new memory of `size` bytes, all zero."""
        descriptor = _anonymous_file()
        os.truncate(descriptor, size)
        return cls(descriptor)

    @classmethod
    def of_process(cls, pid: int) -> "SharedMemory | None":
        """Return the memory of another process of the same user, read-only.

        The file is opened for reading through /proc/PID/fd, without the help of its
        owner; the newest if there are several. None if the process has none or has
        ended.

        Raises:
            PermissionError: the process belongs to another user.
        """
        folder = Path(f"/proc/{pid}/fd")
        candidates: list[tuple[int, int, Path]] = []
        with suppress(FileNotFoundError, ProcessLookupError):
            for link in folder.iterdir():
                with suppress(FileNotFoundError):
                    if os.readlink(link) == _MEMORY_LINK:  # noqa: PTH115
                        created_ns = link.stat().st_ctime_ns
                        candidates.append((created_ns, int(link.name), link))
            if candidates:
                *_, link = max(candidates)
                descriptor = os.open(link, os.O_RDONLY | os.O_CLOEXEC)
                if os.fstat(descriptor).st_size:
                    return cls(descriptor, is_writable=False)
                os.close(descriptor)  # being created
        return None

    def touch(self) -> None:
        """Read every page once, to avoid page faults later."""
        bytes(self.view[:: mmap.PAGESIZE])

    def close(self) -> None:
        """Close the descriptor; existing views of the memory stay valid."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1
