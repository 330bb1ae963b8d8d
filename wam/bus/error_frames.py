"""Error frames of a CAN controller as Linux reports them: classes, counts, condition.

The layout is that of linux/can/error.h: the classes are the low bits of the identifier,
the detail stands in the eight bytes.
"""

from collections import Counter
from enum import IntFlag

from acquisition.devices import BusCondition
from wam.bus.frames import Payload

ERROR_MASK = 0x1FFFFFFF  # all classes, for the socket's filter
# Flags of Linux in an identifier.
ERROR_FLAG, REMOTE_FLAG, EXTENDED_FLAG = 0x20000000, 0x40000000, 0x80000000
_ACKNOWLEDGE = frozenset({0x19, 0x1B})  # slot and delimiter, in data[3]


class ErrorClass(IntFlag):
    """Classes of an error frame, in its identifier."""

    TX_TIMEOUT = 0x001
    LOST_ARBITRATION = 0x002
    CONTROLLER = 0x004
    PROTOCOL = 0x008
    TRANSCEIVER = 0x010
    NO_ACKNOWLEDGEMENT = 0x020
    BUS_OFF = 0x040
    BUS_ERROR = 0x080
    RESTARTED = 0x100
    COUNTERS = 0x200


# What each bit of a byte says, by class: (index of the byte, bit, name).
_CONTROLLER = (
    (0x01, "rx-overflow"),
    (0x02, "tx-overflow"),
    (0x04, "warning"),
    (0x08, "warning"),
    (0x10, "passive"),
    (0x20, "passive"),
    (0x40, "active"),
)
_PROTOCOL = (
    (0x01, "bit"),
    (0x02, "form"),
    (0x04, "stuff"),
    (0x08, "bit"),
    (0x10, "bit"),
    (0x20, "overload"),
)
_PLAIN = (
    (ErrorClass.TX_TIMEOUT, "tx-timeout"),
    (ErrorClass.LOST_ARBITRATION, "lost-arbitration"),
    (ErrorClass.TRANSCEIVER, "transceiver"),
    (ErrorClass.BUS_OFF, "bus-off"),
    (ErrorClass.RESTARTED, "restarted"),
)
_CRC = frozenset({0x08, 0x18})  # locations in data[3]


def error_names(can_id: int, data: Payload) -> frozenset[str]:
    """Return what an error frame reports, each once; "other" where nothing is known.

    Args:
        can_id: identifier with the classes, with or without the flag 0x20000000.
        data: eight bytes; missing ones count as zero.
    """
    detail = bytes(data).ljust(8, b"\0")
    names = {name for bit, name in _PLAIN if can_id & bit}
    # esd_usb leaves the class out that its byte 1 belongs to.
    if can_id & (ErrorClass.CONTROLLER | ErrorClass.PROTOCOL | ErrorClass.BUS_ERROR):
        names |= {name for bit, name in _CONTROLLER if detail[1] & bit}
    if can_id & ErrorClass.PROTOCOL:
        names |= {name for bit, name in _PROTOCOL if detail[2] & bit}
        names |= {"crc"} if detail[3] in _CRC else set()
    is_unheard = can_id & (ErrorClass.PROTOCOL | ErrorClass.BUS_ERROR)
    if can_id & ErrorClass.NO_ACKNOWLEDGEMENT or (
        is_unheard and detail[3] in _ACKNOWLEDGE
    ):
        names.add("no-acknowledgement")
    return frozenset(names or {"other"})


class BusErrors:
    """Counts what error frames report and says what became of the bus.

    Attributes:
        frames: error frames so far.
        counts: how often each name of `error_names` was reported.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.counts: Counter[str] = Counter()
        self._condition = BusCondition.SOUND

    @property
    def condition(self) -> BusCondition:
        """What the error frames since the last complete cycle say."""
        return self._condition

    def add(self, can_id: int, data: Payload) -> None:
        """Count an error frame."""
        names = error_names(can_id, data)
        self.frames += 1
        self.counts.update(names)
        if "bus-off" in names:
            self._condition = BusCondition.OFF
        elif "restarted" in names:
            self._condition = BusCondition.SOUND
        elif self._condition is not BusCondition.OFF:
            # A lone sender becomes passive and stays so; it never leaves the bus.
            if names & {"no-acknowledgement", "passive"}:
                self._condition = BusCondition.UNHEARD
            elif "active" in names:
                self._condition = BusCondition.SOUND

    def confirm(self) -> None:
        """Note that the arm has answered: whatever it was is over."""
        self._condition = BusCondition.SOUND

    def text(self) -> str:
        """Return the counts in words, "" where there were no error frames."""
        return ", ".join(f"{name} {self.counts[name]}" for name in sorted(self.counts))
