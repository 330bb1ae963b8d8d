"""Faults between a wrist sensor's gauges and its wire."""

import math
from enum import Enum, auto

from ft_sensor.reading import Wrench

_GARBLED = 9  # index of the inverted byte of a frame: in the middle of a force
_NOT_A_NUMBER: Wrench = (math.nan, math.inf, 0.0, 0.0, 0.0, 0.0)


class ByteFault(Enum):
    """Faults of one byte on the wire."""

    FLIP = auto()
    DROP = auto()
    DOUBLE = auto()


def damage(data: bytes, fault: ByteFault, index: int, bit: int = 0) -> bytes:
    """Return `data` with the byte at `index` flipped in `bit`, dropped or doubled."""
    byte = data[index : index + 1]
    replacement = {
        ByteFault.FLIP: bytes((byte[0] ^ 1 << bit,)),
        ByteFault.DROP: b"",
        ByteFault.DOUBLE: byte * 2,
    }[fault]
    return data[:index] + replacement + data[index + 1 :]


class StreamFaults:
    """Freezes, falsifies and corrupts a sensor's output, until `clear_faults`.

    Attributes:
        is_garbled: every frame is corrupted in transit.
        is_nonsense: forces are NaN or infinite in frames with a valid checksum.
    """

    def __init__(self) -> None:
        self.is_garbled = False
        self.is_nonsense = False
        self._frozen: tuple[int, ...] = ()
        self._last: Wrench | None = None

    def freeze(self, *axes: int) -> None:
        """Repeat the next wrench in all later samples; the device's clock continues.

        Args:
            axes: the repeated axes, 0 to 5; none = all.
        """
        self._frozen = axes or tuple(range(6))
        self._last = None

    def clear_faults(self) -> None:
        """Clear all injected faults."""
        self.is_garbled = self.is_nonsense = False
        self._frozen = ()

    def show(self, wrench: Wrench) -> Wrench:
        """Return the reading of `wrench` with the faults [N, N m]."""
        if self.is_nonsense:
            return _NOT_A_NUMBER
        if self._frozen:
            reading = list(wrench)
            self._last = last = self._last or wrench
            for axis in self._frozen:
                reading[axis] = last[axis]
            fx, fy, fz, tx, ty, tz = reading
            return fx, fy, fz, tx, ty, tz
        return wrench

    def carry(self, frame: bytes) -> bytes:
        """Return `frame` as it arrives."""
        if not self.is_garbled:
            return frame
        inverted = frame[_GARBLED] ^ 0xFF
        return frame[:_GARBLED] + bytes((inverted,)) + frame[_GARBLED + 1 :]
