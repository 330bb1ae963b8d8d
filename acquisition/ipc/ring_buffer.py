"""A ring buffer of records for one writer and any number of readers, without locks.

A record is written before the counter is raised, so a reader never takes one that is
half written; what the writer has overwritten is counted as lost.
"""

import numpy as np

from acquisition.ipc.shared_memory import LINE, lines
from acquisition.sample import Record

LayoutType = np.dtype[np.void]


class RingBuffer:
    """Fixed records in memory that may be shared: a ring with one writer, any readers.

    The record being written is never handed out, so `slots - 1` records can be read.

    Attributes:
        slots: number of slots for records; record n goes to slot n % slots.
        layout: number of slots, and bytes from one to the next.
        memory: the slots, for a writer that packs its records there.
        counter: one number, of records written: a writer raises it behind each record.
    """

    def __init__(self, memory: memoryview, dtype: LayoutType, slots: int) -> None:
        """Lay the buffer over `memory` of at least `size_of(dtype, slots)` bytes."""
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
        """Return how much memory such a buffer needs [bytes]."""
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


class RingBufferReader:
    """Reads a ring buffer from where it last stopped.

    Attributes:
        lost: records that were overwritten before they were read.
    """

    def __init__(self, buffer: RingBuffer) -> None:
        self._buffer = buffer
        self._position = buffer.written
        self.lost = 0

    @property
    def backlog(self) -> int:
        """Records that have been written and not read."""
        return self._buffer.written - self._position

    def rewind(self, records: int) -> None:
        """Go back so that the next read begins `records` records earlier."""
        oldest = max(0, self._buffer.written - self._buffer.slots + 1)
        self._position = max(oldest, self._position - records)

    def read(self) -> Record:
        """Return every record that is new, in order; counts what was lost."""
        records, lost = self._buffer.since(self._position)
        self._position += len(records) + lost
        self.lost += lost
        return records
