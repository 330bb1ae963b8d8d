"""Hand-over between processes: rings of records and newest-value slots, no locks.

Each has one writer. The payload is written before the counter, so a reader never takes
a record that is half written; what the writer has overwritten is counted as lost.

That order of stores is kept between processors by x86 alone: on other machines, ARM
among them, a counter may be seen before its record. Processes are refused there, see
`require_ordered_stores`; a rig in one thread has no second processor to mind.
"""

import ctypes
import mmap
import os
import platform
from contextlib import suppress
from pathlib import Path

import numpy as np

from acquisition.errors import PreflightError
from acquisition.sample import Record

_MEMORY_NAME = "traction"
_MEMORY_LINK = f"/memfd:{_MEMORY_NAME} (deleted)"  # as /proc shows it
ORDERED_MACHINES = frozenset({"x86_64", "AMD64", "i386", "i686"})


def require_ordered_stores() -> None:
    """Refuse a machine whose processors may see stores in another order.

    Raises:
        PreflightError: it is no x86.
    """
    machine = platform.machine()
    if machine not in ORDERED_MACHINES:
        raise PreflightError(
            f"This machine is {machine or 'unknown'}: processes that share memory need "
            "an x86 (64 or 32 bit), which keeps the order of stores.",
            hint="Use an x86 machine; simulations run here with --fake --fast.",
            arm_state="not touched",
        )


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
        descriptor = os.memfd_create(_MEMORY_NAME, os.MFD_CLOEXEC)
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
            for place in folder.iterdir():
                with suppress(FileNotFoundError):
                    if os.readlink(place) == _MEMORY_LINK:  # noqa: PTH115
                        made_ns = place.stat().st_ctime_ns
                        found.append((made_ns, int(place.name), place))
            if found:
                *_, place = max(found)
                descriptor = os.open(place, os.O_RDONLY | os.O_CLOEXEC)
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


def give_back_heap() -> None:
    """Return memory that is free to the kernel, where the C library can do so.

    What a finished trial has used would otherwise stay with its process in pieces.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


LINE = 64  # bytes of a cache line; a record begins at a multiple of it
_LENGTH_BYTES = 8
_TRIES = 100  # a reader that is beaten this often takes what is there for nothing

LayoutType = np.dtype[np.void]


def lines(size: int) -> int:
    """Return `size` [bytes] rounded up to whole cache lines."""
    return -(-size // LINE) * LINE


class Ring:
    """A ring of fixed records in memory that may be shared: one writer, any readers.

    The record being written is never handed out, so `slots - 1` records can be read.

    Attributes:
        slots: places for records; record n goes to place n % slots.
        places: number of places, and bytes from one to the next.
        memory: the places, for a writer that packs its records there.
        counter: one number, of records written: a writer raises it behind each record.
    """

    def __init__(self, memory: memoryview, dtype: LayoutType, slots: int) -> None:
        """Lay the ring over `memory` of at least `size_of(dtype, slots)` bytes."""
        self.slots = slots
        self._size = dtype.itemsize
        self._stride = lines(dtype.itemsize)
        self.places = (slots, self._stride)
        self.counter = memory[:8].cast("Q")
        self.memory = memory[LINE : self.size_of(dtype, slots)]
        self._records: Record = np.ndarray(
            (slots,), dtype, self.memory, strides=(self._stride,)
        )

    @staticmethod
    def size_of(dtype: LayoutType, slots: int) -> int:
        """Return how much memory such a ring needs [bytes]."""
        return LINE + slots * lines(dtype.itemsize)

    @property
    def written(self) -> int:
        """Number of records written since the start."""
        return self.counter[0]

    def write(self, payload: bytes | memoryview) -> None:
        """Append one record, given as its bytes."""
        counter = self.counter
        number = counter[0]
        start = number % self.slots * self._stride
        self.memory[start : start + self._size] = payload
        counter[0] = number + 1

    def reader(self) -> "RingReader":
        """Return a reader that starts at the next record."""
        return RingReader(self)

    def since(self, position: int) -> tuple[Record, int]:
        """Return (records from `position` on, number lost because overwritten)."""
        end = self.written
        start = min(end, max(position, end - self.slots + 1))
        records = self._records[np.arange(start, end) % self.slots]
        # While they were copied the writer may have come round.
        intact = self.written - self.slots + 1
        if intact > start:
            records = records[intact - start :]
            start = min(end, intact)
        return records, start - position

    def last(self, count: int) -> Record:
        """Return the newest records, `count` at most, oldest first."""
        return self.since(max(0, self.written - count))[0]


class RingReader:
    """Reads a ring from where it last stopped.

    Attributes:
        lost: records that were overwritten before they were read.
    """

    def __init__(self, ring: Ring) -> None:
        self._ring = ring
        self._position = ring.written
        self.lost = 0

    @property
    def backlog(self) -> int:
        """Records that have been written and not read."""
        return self._ring.written - self._position

    @property
    def position(self) -> int:
        """Number of the record that is read next, counted since the start."""
        return self._position

    def seek(self, position: int) -> None:
        """Read from record number `position` on, or the oldest that there is."""
        oldest = max(0, self._ring.written - self._ring.slots + 1)
        self._position = min(max(oldest, position), self._ring.written)

    def rewind(self, records: int) -> None:
        """Go back so that the next read begins `records` records earlier."""
        oldest = max(0, self._ring.written - self._ring.slots + 1)
        self._position = max(oldest, self._position - records)

    def read(self) -> Record:
        """Return every record that is new, in order; counts what was lost."""
        records, lost = self._ring.since(self._position)
        self._position += len(records) + lost
        self.lost += lost
        return records


class Slot:
    """The newest value of something, as bytes of changing length: one writer.

    A counter is odd while the value is being written; a reader looks at it before and
    after.
    """

    def __init__(self, memory: memoryview) -> None:
        """Lay the slot over `memory`, whose size is the largest value plus 64."""
        self._counter = memory[:8].cast("Q")
        self._length = memory[_LENGTH_BYTES : 2 * _LENGTH_BYTES].cast("Q")
        self._bytes = memory[LINE:]

    @property
    def version(self) -> int:
        """Number that changes with every new value."""
        return self._counter[0]

    def write(self, value: bytes) -> None:
        """Replace the value.

        Raises:
            ValueError: it does not fit.
        """
        if len(value) > len(self._bytes):
            raise ValueError(f"{len(value)} bytes, the slot has {len(self._bytes)}")
        counter = self._counter
        counter[0] += 1
        self._length[0] = len(value)
        self._bytes[: len(value)] = value
        counter[0] += 1

    def read(self) -> bytes:
        """Return the newest whole value; empty before the first one."""
        for _ in range(_TRIES):
            before = self._counter[0]
            value = bytes(self._bytes[: self._length[0]])
            if before % 2 == 0 and self._counter[0] == before:
                return value
        return b""
