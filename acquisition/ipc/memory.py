"""Memory that several processes map: an anonymous file that leaves nothing behind."""

import ctypes
import mmap
import os


class SharedMemory:
    """A mapped file in memory without a name; it is gone with its last user.

    A child gets the descriptor, never a name, so nobody else can open it and nothing
    is left in /dev/shm when every process is killed.

    Attributes:
        descriptor: of the file, to be inherited by a child.
        view: the memory itself, writable.
    """

    def __init__(self, descriptor: int) -> None:
        """Map the file behind `descriptor`, which belongs to this object now."""
        self.descriptor = descriptor
        self._map = mmap.mmap(descriptor, os.fstat(descriptor).st_size)
        self.view = memoryview(self._map)

    @classmethod
    def create(cls, size: int) -> "SharedMemory":
        """Return new memory of `size` bytes, all zero."""
        descriptor = os.memfd_create("traction", os.MFD_CLOEXEC)
        os.truncate(descriptor, size)
        return cls(descriptor)

    def touch(self) -> None:
        """Look at every page, so that none has to be waited for later."""
        bytes(self.view[:: mmap.PAGESIZE])

    def close(self) -> None:
        """Close the descriptor; views of the memory stay valid until they are gone."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1


def give_back_heap() -> None:
    """Return memory that is free to the kernel, where the C library can do so.

    What a finished trial has used would otherwise stay with its process in pieces.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
