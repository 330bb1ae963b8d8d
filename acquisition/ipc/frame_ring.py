"""Ring buffer of raw CAN frames for the flight record of a fault."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from acquisition.clock import Clock
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.record_layout import GAP, struct_of
from acquisition.sample import Record

SECONDS = 2.0
FRAME_DTYPE = np.dtype(
    [
        ("t_ns", "<u8"),
        ("can_id", "<u4"),
        ("length", "u1"),
        (GAP, "V3"),
        ("data", "V8"),
    ]
)
_FRAME: Final = struct_of(FRAME_DTYPE)


class FrameRing:
    """Writes the frames of the bus to a ring buffer that outlives its writer."""

    def __init__(self, buffer: RingBuffer, clock: Clock) -> None:
        self._clock = clock
        self._target = (buffer.counter, buffer.memory, *buffer.layout, _FRAME.pack_into)

    def add(self, frames: Iterable[tuple[int, bytes, int]]) -> None:
        """Append frames just sent or received, oldest first; overwrites the oldest.

        Args:
            frames: (identifier, data, monotonic time [ns]), time 0 = now.
        """
        now_ns = self._clock.now_ns()
        counter, memory, slots, stride, pack_into = self._target
        number = counter[0]
        for can_id, data, t_ns in frames:
            offset = number % slots * stride
            pack_into(memory, offset, t_ns or now_ns, can_id, len(data), data)
            number += 1
            counter[0] = number


def last_frames(buffer: RingBuffer, seconds: float = SECONDS) -> Record:
    """Return the frames of the `seconds` up to the newest one, oldest first."""
    frames = buffer.last(buffer.slots)
    if not len(frames):
        return frames
    earliest = int(frames["t_ns"][-1]) - int(seconds * 1e9)
    return frames[frames["t_ns"].astype(np.int64) >= earliest]
