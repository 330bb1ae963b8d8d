"""Memory that processes share: how it is found, sized, and which machines may.

Ring buffers and latest-value slots in it have one writer and no locks: the payload is
written before the counter. That order of stores is kept between processors by x86
alone: on other machines, ARM among them, a counter may be seen before its record.
Processes are refused there; a rig in one thread has no second processor to mind.
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
_MEMORY_LINK = f"/memfd:{_MEMORY_NAME} (deleted)"  # as /proc shows it


def lines(size: int) -> int:
    """Return `size` [bytes] rounded up to whole cache lines."""
    return -(-size // LINE) * LINE


def require_ordered_stores() -> None:
    """Refuse a system without what processes need, or whose stores may be reordered.

    Raises:
        PreflightError: it is no Linux, or no x86.
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
    """Return the descriptor of an empty file in memory, or of one without a name."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create(_MEMORY_NAME, os.MFD_CLOEXEC)
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


class SharedMemory:
    """A mapped file in memory without a name; it is gone with its last user.

    A child gets the descriptor, never a name, so nobody else can open it and nothing
    is left in /dev/shm when every process is killed.

    Attributes:
        descriptor: of the file, to be inherited by a child.
        view: the memory itself, writable unless it was only looked up.
    """

    def __init__(self, descriptor: int, *, is_writable: bool = True) -> None:
        """Map the file behind `descriptor`, which belongs to this object now."""
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
        """Return the memory of another process of the same user, to be read only.

        It is opened anew, for reading, through /proc: nothing is asked of its owner,
        and nothing can be written. Of several it is the newest. None where the process
        has none, or has gone.

        Raises:
            PermissionError: the process belongs to somebody else.
        """
        folder = Path(f"/proc/{pid}/fd")
        found: list[tuple[int, int, Path]] = []
        with suppress(FileNotFoundError, ProcessLookupError):
            for link in folder.iterdir():
                with suppress(FileNotFoundError):
                    if os.readlink(link) == _MEMORY_LINK:  # noqa: PTH115
                        made_ns = link.stat().st_ctime_ns
                        found.append((made_ns, int(link.name), link))
            if found:
                *_, link = max(found)
                descriptor = os.open(link, os.O_RDONLY | os.O_CLOEXEC)
                if os.fstat(descriptor).st_size:
                    return cls(descriptor, is_writable=False)
                os.close(descriptor)  # it is being made
        return None

    def touch(self) -> None:
        """Look at every page, so that none has to be waited for later."""
        bytes(self.view[:: mmap.PAGESIZE])

    def close(self) -> None:
        """Close the descriptor; views of the memory stay valid until they are gone."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1
