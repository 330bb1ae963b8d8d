"""Lock-free ring buffer of records for one writer and any number of readers.

A record is written before the counter is incremented, so a reader never sees a partial
record; overwritten records count as lost.
"""

import numpy as np

from acquisition.ipc.shared_memory import LINE, lines
from acquisition.sample import Record

LayoutType = np.dtype[np.void]


class RingBuffer:
    """Ring buffer of fixed-size records in possibly shared memory.

    The slot being written is never read, so `slots - 1` records are available.

    Attributes:
        slots: number of slots; record n is in slot n % slots.
        layout: number of slots and their stride [bytes].
        memory: memory of the slots, for a writer that packs records in place.
        counter: number of records written, shape (1,); the writer increments it after
            each record.
    """

    def __init__(self, memory: memoryview, dtype: LayoutType, slots: int) -> None:
        """Map the buffer to `memory` of at least `size_of(dtype, slots)` bytes."""
        self.slots = slots
        self._size = dtype.itemsize
        self._stride = lines(dtype.itemsize)
        self.layout = (slots, self._stride)
        self.counter = memory[:8].cast("Q")
        self.memory = memory[LINE : self.size_of(dtype, slots)]
        self._records: Record = np.ndarray(
            (slots,), dtype, self.memory, strides=(self._stride,)
        )

    @staticmethod
    def size_of(dtype: LayoutType, slots: int) -> int:
        """Return the size of the memory of such a buffer [bytes]."""
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

    def reader(self) -> "RingBufferReader":
        """Return a reader that starts at the next record."""
        return RingBufferReader(self)

    def since(self, position: int) -> tuple[Record, int]:
        """Return (records from `position` on, number of overwritten ones)."""
        end = self.written
        start = min(end, max(position, end - self.slots + 1))
        records = self._records[np.arange(start, end) % self.slots]
        # The writer may have overwritten some during the copy.
        intact = self.written - self.slots + 1
        if intact > start:
            records = records[intact - start :]
            start = min(end, intact)
        return records, start - position

    def last(self, count: int) -> Record:
        """Return up to `count` newest records, oldest first."""
        return self.since(max(0, self.written - count))[0]


class RingBufferReader:
    """Sequential reader of a ring buffer.

    Attributes:
        lost: number of records overwritten before they were read.
    """

    def __init__(self, buffer: RingBuffer) -> None:
        self._buffer = buffer
        self._position = buffer.written
        self.lost = 0

    @property
    def backlog(self) -> int:
        """Number of unread records."""
        return self._buffer.written - self._position

    def rewind(self, records: int) -> None:
        """Move the read position back by up to `records` records."""
        oldest = max(0, self._buffer.written - self._buffer.slots + 1)
        self._position = max(oldest, self._position - records)

    def read(self) -> Record:
        """Return all new records in order; counts lost ones."""
        records, lost = self._buffer.since(self._position)
        self._position += len(records) + lost
        self.lost += lost
        return records
