"""Decoding of the two message types of an import: JointState and WrenchStamped.

The layout is that of the ROS packages; definitions inside a file are ignored. CDR
aligns every number to its own size, counted after the four bytes that state the byte
order (plain CDR of DDS-XTypes 1.3, 7.4.3); ROS 1 does not align, is little-endian, and
its header begins with a counter.
"""

import struct
from dataclasses import dataclass
from typing import Any

from analysis.logs.log_file import LONGEST_NAME, Serialization

JOINT_STATE = "sensor_msgs/JointState"
WRENCH_STAMPED = "geometry_msgs/WrenchStamped"
STAMPED = (JOINT_STATE, WRENCH_STAMPED)
MOST_JOINTS = 10_000
_NS = 10**9


class MessageError(ValueError):
    """A message does not match its type; the text says where."""


@dataclass(frozen=True, slots=True)
class Header:
    """Message header.

    Attributes:
        stamp_ns: time stamp [UTC ns]; 0 if not set.
        frame_id: frame; may be empty.
    """

    stamp_ns: int
    frame_id: str


@dataclass(frozen=True, slots=True)
class JointMessage:
    """Content of a sensor_msgs/JointState.

    Attributes:
        header: header.
        names: names of the joints.
        position: positions [rad, m], one per joint; empty if the message has none.
        velocity: velocities [rad/s, m/s], one per joint; empty if there are none.
    """

    header: Header
    names: tuple[str, ...]
    position: tuple[float, ...]
    velocity: tuple[float, ...]


def read_header(data: bytes, serialization: Serialization) -> Header:
    """Decode the header of a stamped message; raises MessageError."""
    return _Cursor(data, serialization).header()


def read_joints(data: bytes, serialization: Serialization) -> JointMessage:
    """Decode a JointState.

    Raises:
        MessageError: the message is too short, or states an absurd count.
    """
    cursor = _Cursor(data, serialization)
    header, count = cursor.header(), cursor.count(4)
    names = tuple(cursor.text() for _ in range(count))
    return JointMessage(header, names, cursor.numbers(), cursor.numbers())


def read_wrench(
    data: bytes, serialization: Serialization
) -> tuple[Header, tuple[float, ...]]:
    """Decode a WrenchStamped: header, and force [N] and torque [N m], six numbers.

    Raises:
        MessageError: the message is too short.
    """
    cursor = _Cursor(data, serialization)
    return cursor.header(), cursor.doubles(6)


class _Cursor:
    """Reads the fields of a message in sequence."""

    def __init__(self, data: bytes, serialization: Serialization) -> None:
        self._data, self._is_cdr = data, serialization == "cdr"
        self._order, self._at = "<", 0
        if self._is_cdr:
            if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
                raise MessageError(f"it begins with {data[:2].hex()}, not as plain CDR")
            self._order = "<" if data[1] else ">"
            self._at = 4

    def header(self) -> Header:
        if not self._is_cdr:
            self._integer()  # the counter of ROS 1
        seconds, nanoseconds = self._integer(), self._integer()
        return Header(seconds * _NS + nanoseconds, self.text())

    def count(self, size: int) -> int:
        """Read an element count, limited to elements of `size` bytes that can fit."""
        count = self._integer()
        if count > MOST_JOINTS or count * size > len(self._data) - self._at:
            raise MessageError(f"it states {count} elements")
        return count

    def text(self) -> str:
        size = self._integer()
        if size > LONGEST_NAME or size > len(self._data) - self._at:
            raise MessageError(f"it states a text of {size} bytes")
        text = self._data[self._at : self._at + size]
        self._at += size
        return text.rstrip(b"\0").decode(errors="replace")

    def numbers(self) -> tuple[float, ...]:
        count = self.count(8)
        return self.doubles(count) if count else ()

    def doubles(self, count: int) -> tuple[float, ...]:
        return self._unpack(f"{self._order}{count}d", 8, 8 * count)

    def _integer(self) -> int:
        return self._unpack(f"{self._order}I", 4, 4)[0]

    def _unpack(self, layout: str, alignment: int, size: int) -> tuple[Any, ...]:
        if self._is_cdr:
            self._at += -(self._at - 4) % alignment
        try:
            values = struct.unpack_from(layout, self._data, self._at)
        except struct.error as error:
            raise MessageError("it is shorter than its type") from error
        self._at += size
        return values
