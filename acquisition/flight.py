"""The flight record: the last two seconds with raw frames, written on a fault."""

import struct
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from acquisition.cdr import CdrWriter

SECONDS = 2.0
_CAN_FRAME = struct.Struct("<IB3x8s")


@dataclass(frozen=True, slots=True)
class RawFrame:
    """One CAN frame as it passed: monotonic time [ns], identifier, data."""

    t_ns: int
    can_id: int
    data: bytes


class FrameTape:
    """Keeps the frames of the last two seconds, about 13,000 of them."""

    def __init__(self, frames: int = 13_000) -> None:
        self._frames: deque[RawFrame] = deque(maxlen=frames)

    def add(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Keep one frame; the oldest is forgotten."""
        self._frames.append(RawFrame(t_ns, can_id, data))

    def last(self, seconds: float = SECONDS) -> list[RawFrame]:
        """Return the frames of the last `seconds` before the newest one."""
        if not self._frames:
            return []
        earliest = self._frames[-1].t_ns - int(seconds * 1e9)
        return [frame for frame in self._frames if frame.t_ns >= earliest]


def encode_can_batch(log_time: int, frames: Iterable[RawFrame]) -> bytes:
    """Return a traction_msgs/CanBatch payload of struct can_frame records."""
    frames = list(frames)
    raw = b"".join(
        _CAN_FRAME.pack(f.can_id, len(f.data), f.data.ljust(8, b"\0")) for f in frames
    )
    writer = CdrWriter().header(log_time, "can")
    writer.sequence(np.array([f.t_ns for f in frames], np.uint64))
    return writer.sequence(np.frombuffer(raw, np.uint8)).finish()
