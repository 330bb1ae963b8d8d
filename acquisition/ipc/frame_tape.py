"""The flight record: the last two seconds with raw frames, written on a fault."""

import struct
from collections.abc import Iterable
from typing import Final

import numpy as np

from acquisition.ipc.rings import Ring
from acquisition.sample import Record

SECONDS = 2.0
_FRAME: Final = struct.Struct("<QIB3x8s")


class FrameTape:
    """Writes the frames of the bus into a ring that outlives its writer."""

    def __init__(self, ring: Ring) -> None:
        self._ring = ring

    def add(self, frames: Iterable[tuple[int, int, int, bytes]]) -> None:
        """Keep frames; the oldest are forgotten.

        Args:
            frames: monotonic time [ns], identifier, length and data of each.
        """
        self._ring.pack(_FRAME, frames)


def last_frames(ring: Ring, seconds: float = SECONDS) -> Record:
    """Return the frames of the last `seconds` before the newest one, oldest first."""
    frames = ring.last(ring.slots)
    if not len(frames):
        return frames
    earliest = int(frames["t_ns"][-1]) - int(seconds * 1e9)
    return frames[frames["t_ns"].astype(np.int64) >= earliest]
