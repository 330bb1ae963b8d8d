"""What may go wrong between a wrist sensor's gauges and its wire."""

import math
from enum import Enum, auto

from ft_sensor.reading import Wrench

_GARBLED = 9  # byte of a frame that is inverted: in the middle of a force
_NOT_A_NUMBER: Wrench = (math.nan, math.inf, 0.0, 0.0, 0.0, 0.0)


class ByteFault(Enum):
    """What may happen to one byte on the wire."""

    FLIP = auto()
    DROP = auto()
    DOUBLE = auto()


def damage(data: bytes, fault: ByteFault, index: int, bit: int = 0) -> bytes:
    """Return `data` with one byte, at `index`, flipped in `bit`, dropped or doubled."""
    byte = data[index : index + 1]
    middle = {
        ByteFault.FLIP: bytes((byte[0] ^ 1 << bit,)),
        ByteFault.DROP: b"",
        ByteFault.DOUBLE: byte * 2,
    }[fault]
    return data[:index] + middle + data[index + 1 :]


class StreamFaults:
    """Freezes, spoils and garbles what a sensor says, until `clear_faults`.

    Attributes:
        is_garbled: no frame reaches the host as it was sent.
        is_nonsense: forces are no numbers, although the checksum is right.
    """

    def __init__(self) -> None:
        self.is_garbled = False
        self.is_nonsense = False
        self._frozen: tuple[int, ...] = ()
        self._last: Wrench | None = None

    def freeze(self, *axes: int) -> None:
        """Repeat the next wrench for ever; the device's clock goes on.

        Args:
            axes: 0 to 5, that are repeated; none = all.
        """
        self._frozen = axes or tuple(range(6))
        self._last = None

    def clear_faults(self) -> None:
        """Show and send everything as it is."""
        self.is_garbled = self.is_nonsense = False
        self._frozen = ()

    def show(self, wrench: Wrench) -> Wrench:
        """Return what the device makes of `wrench` [N, N m]."""
        if self.is_nonsense:
            return _NOT_A_NUMBER
        if self._frozen:
            shown = list(wrench)
            self._last = last = self._last or wrench
            for axis in self._frozen:
                shown[axis] = last[axis]
            fx, fy, fz, tx, ty, tz = shown
            return fx, fy, fz, tx, ty, tz
        return wrench

    def carry(self, frame: bytes) -> bytes:
        """Return what arrives of `frame`."""
        if not self.is_garbled:
            return frame
        spoilt = frame[_GARBLED] ^ 0xFF
        return frame[:_GARBLED] + bytes((spoilt,)) + frame[_GARBLED + 1 :]
