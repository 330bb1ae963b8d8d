"""CAN controller error frames as Linux reports them: classes, counts, bus state.

Layout of linux/can/error.h: the low bits of the identifier are the error classes, the
eight data bytes hold the details.
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
    """Error classes in the identifier of an error frame."""

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


# (bit, name) of data[1], data[2] and of the identifier
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
_CLASSES = (
    (ErrorClass.TX_TIMEOUT, "tx-timeout"),
    (ErrorClass.LOST_ARBITRATION, "lost-arbitration"),
    (ErrorClass.TRANSCEIVER, "transceiver"),
    (ErrorClass.BUS_OFF, "bus-off"),
    (ErrorClass.RESTARTED, "restarted"),
)
_CRC = frozenset({0x08, 0x18})  # locations in data[3]


def error_names(can_id: int, data: Payload) -> frozenset[str]:
    """Return the names of the errors in an error frame; "other" if none is known.

    Args:
        can_id: identifier with the classes, with or without the flag 0x20000000.
        data: up to eight bytes, padded with zeros.
    """
    detail = bytes(data).ljust(8, b"\0")
    names = {name for bit, name in _CLASSES if can_id & bit}
    # The driver esd_usb fills byte 1 without setting the class CONTROLLER.
    if can_id & (ErrorClass.CONTROLLER | ErrorClass.PROTOCOL | ErrorClass.BUS_ERROR):
        names |= {name for bit, name in _CONTROLLER if detail[1] & bit}
    if can_id & ErrorClass.PROTOCOL:
        names |= {name for bit, name in _PROTOCOL if detail[2] & bit}
        names |= {"crc"} if detail[3] in _CRC else set()
    has_location = can_id & (ErrorClass.PROTOCOL | ErrorClass.BUS_ERROR)
    if can_id & ErrorClass.NO_ACKNOWLEDGEMENT or (
        has_location and detail[3] in _ACKNOWLEDGE
    ):
        names.add("no-acknowledgement")
    return frozenset(names or {"other"})


class BusErrors:
    """Error frame counters and the bus condition derived from them.

    Attributes:
        frames: error frames so far.
        counts: occurrences of each name of `error_names`.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.counts: Counter[str] = Counter()
        self._condition = BusCondition.SOUND

    @property
    def condition(self) -> BusCondition:
        """Bus condition according to the error frames since the last complete cycle."""
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
            # A node alone on the bus becomes error passive but never goes bus-off.
            if names & {"no-acknowledgement", "passive"}:
                self._condition = BusCondition.UNACKNOWLEDGED
            elif "active" in names:
                self._condition = BusCondition.SOUND

    def confirm(self) -> None:
        """Reset the condition to sound: the arm has answered."""
        self._condition = BusCondition.SOUND

    def text(self) -> str:
        """Return the counts as text, "" if there were no error frames."""
        return ", ".join(f"{name} {self.counts[name]}" for name in sorted(self.counts))
