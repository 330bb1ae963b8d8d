"""Hand-over of samples from the loop to the recorder: one writer, one reader."""

import numpy as np

from acquisition.messages import CYCLE
from acquisition.sample import Record

SLOTS = 8192  # 16 s at 500 Hz


class SampleRing:
    """A ring of cycle records; a lapped reader learns how many it lost.

    The payload is written before the counter, so a reader never sees a half-written
    newest record.
    """

    def __init__(self, slots: int = SLOTS) -> None:
        self.slots = slots
        self._records = np.zeros(slots, CYCLE.dtype)
        size = CYCLE.size
        self._raw = self._records.view(np.uint8).reshape(slots, size)
        self.written = 0

    def write(self, payload: memoryview) -> None:
        """Append one record (bytes of traction_msgs/Cycle)."""
        self._raw[self.written % self.slots] = payload
        self.written += 1

    def reader(self) -> "RingReader":
        """Return a reader that starts at the next record."""
        return RingReader(self)

    def since(self, position: int) -> tuple[Record, int]:
        """Return (records from `position` on, number lost because overwritten)."""
        end = self.written
        start = max(position, end - self.slots)
        indices = np.arange(start, end) % self.slots
        return self._records[indices], start - position

    def latest(self) -> Record:
        """Return the newest record, shape (1,); empty before the first write."""
        return self.since(max(0, self.written - 1))[0]


class RingReader:
    """Reads a SampleRing from where it last stopped."""

    def __init__(self, ring: SampleRing) -> None:
        self._ring = ring
        self._position = ring.written
        self.lost = 0

    def rewind(self, records: int) -> None:
        """Go back so that the next read begins `records` records earlier."""
        oldest = max(0, self._ring.written - self._ring.slots)
        self._position = max(oldest, self._position - records)

    def read(self) -> Record:
        """Return every record that is new, in order; counts what was lost."""
        records, lost = self._ring.since(self._position)
        self._position += len(records) + lost
        self.lost += lost
        return records
