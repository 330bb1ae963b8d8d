"""Codec of the WAM's CAN frames: identifiers, properties, positions, torques.

No I/O. Received frames are validated: a malformed one raises `FrameError`. Layouts:
Barrett's CAN bus specification and the libbarrett driver.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import floor
from typing import NamedTuple

from acquisition.errors import DeviceFaultError

HOST = 0
SAFETY_NODE = 10
SENSOR_NODE = 8
MOTOR_NODES = range(1, 8)
HAND_NODES = range(11, 15)

GROUP_BIT = 0x400
TORQUE_LIMIT = 8191  # a 14-bit field, -8192 is never sent
POSITION_MODULUS = 1 << 22
_POSITION_MASK = POSITION_MODULUS - 1
_POSITION_SIGN = 1 << 21
TORQUE_SIGNS = 0x2000 << 42 | 0x2000 << 28 | 0x2000 << 14 | 0x2000
_FORCE_PER_N = 256.0
_TORQUE_PER_NM = 4096.0
_ACCELERATION_SCALE = 1024.0

Payload = bytes | bytearray


class Group(IntEnum):
    """Group numbers a frame can be addressed to."""

    BUS = 0
    LOWER_TORQUE = 1
    WRIST_TORQUE = 2
    POSITION = 3
    ARM = 4
    HAND = 5
    PROPERTY = 6
    JOINT_ENCODER = 7
    FORCE = 10
    TORQUE = 11
    ACCELERATION = 12


class FrameError(DeviceFaultError):
    """A frame whose bytes contradict the protocol."""

    def __init__(self, what: str, data: Payload) -> None:
        super().__init__(
            f"{what}: {bytes(data).hex(' ') or 'no bytes'}.",
            hint="Another program on the bus, or a device of another kind?",
        )


@dataclass(frozen=True, slots=True)
class Address:
    """Fields of an 11-bit identifier.

    Attributes:
        sender: node id of the sender, 0 = host.
        to: node id or group number of the receiver.
        is_group: whether `to` is a group.
    """

    sender: int
    to: int
    is_group: bool


def compose_id(sender: int, to: int, *, is_group: bool) -> int:
    """Return the identifier of a frame; ValueError if a field exceeds five bits."""
    if not (0 <= sender < 32 and 0 <= to < 32):
        raise ValueError(f"nodes and groups are 0 to 31, not {sender} and {to}")
    return (GROUP_BIT if is_group else 0) | sender << 5 | to


def split_id(can_id: int) -> Address:
    """Return the fields of an identifier; ValueError if it exceeds 11 bits."""
    if not 0 <= can_id < 0x800:
        raise ValueError(f"{can_id:#x} is not an 11-bit identifier")
    return Address(can_id >> 5 & 0x1F, can_id & 0x1F, bool(can_id & GROUP_BIT))


def group_id(group: Group, sender: int = HOST) -> int:
    """Return the identifier of a frame from `sender` to `group`."""
    return compose_id(sender, group, is_group=True)


_ADDRESSED = frozenset((*MOTOR_NODES, SENSOR_NODE, SAFETY_NODE))
_REPORTING = frozenset((*MOTOR_NODES, *HAND_NODES))
_COMMANDED = frozenset(
    (Group.BUS, Group.LOWER_TORQUE, Group.WRIST_TORQUE, Group.ARM, Group.HAND)
)
MODE_BROADCAST_ID = compose_id(SAFETY_NODE, Group.BUS, is_group=True)


def is_host_id(can_id: int) -> bool:
    """Return whether only a host sends frames with this 11-bit identifier.

    Devices accept a frame with any sender field, and they send to feedback groups only,
    never to each other. So a frame addressed to a device of the arm, or to a group for
    requests and commands, is from a host. The same holds for a position report of a
    node that is not a motor puck: the safety module would count it as a heartbeat.
    """
    address = split_id(can_id)
    if address.sender == HOST:
        return True
    if not address.is_group:
        return address.to in _ADDRESSED
    if address.to == Group.POSITION:
        return address.sender not in _REPORTING
    return address.to in _COMMANDED and can_id != MODE_BROADCAST_ID


def property_reply_id(node: int) -> int:
    """Return the identifier under which `node` answers a GET."""
    return compose_id(node, Group.PROPERTY, is_group=True)


def position_reply_id(node: int) -> int:
    """Return the identifier under which motor puck `node` reports its position."""
    return compose_id(node, Group.POSITION, is_group=True)


class Property(NamedTuple):
    """A property number and its value; None in a GET."""

    number: int
    value: int | None


def encode_get(number: int) -> bytes:
    """Return the one-byte payload of a GET of property `number`."""
    return bytes((_checked_number(number),))


def encode_set(number: int, value: int) -> bytes:
    """Return the six-byte payload that sets property `number` to an int32 `value`."""
    return struct.pack("<BBi", 0x80 | _checked_number(number), 0, value)


def encode_reply(number: int, value: int, *, is_wide: bool) -> bytes:
    """Return a device's answer to a GET: six bytes if `is_wide`, otherwise four."""
    layout = "<BBi" if is_wide else "<BBh"
    return struct.pack(layout, 0x80 | _checked_number(number), 0, value)


def decode_reply(data: Payload) -> Property:
    """Return property and value of a reply, sign-extended from the received width.

    Raises:
        FrameError: the length is neither 4 nor 6, bit 7 of byte 0 is clear or byte 1
            is not zero.
    """
    if len(data) not in (4, 6):
        raise FrameError("A property reply has 4 or 6 bytes", data)
    if not data[0] & 0x80 or data[1]:
        raise FrameError("Not a property reply", data)
    return Property(data[0] & 0x7F, int.from_bytes(data[2:], "little", signed=True))


def decode_request(data: Payload) -> Property:
    """Return property and value of a host's GET or SET, as a device decodes it.

    Raises:
        FrameError: neither a GET of one byte nor a SET of four or six.
    """
    if len(data) == 1 and not data[0] & 0x80:
        return Property(data[0], None)
    return decode_reply(data)


def _checked_number(number: int) -> int:
    if not 0 <= number < 128:
        raise ValueError(f"a property number is 0 to 127, not {number}")
    return number


def wrap_positions(counts: Sequence[int]) -> list[int]:
    """Return motor positions [encoder counts] wrapped to signed 22 bits."""
    half = _POSITION_SIGN
    return [(count + half) % POSITION_MODULUS - half for count in counts]


def encode_position(counts: int) -> bytes:
    """Return the three-byte payload of one motor position [encoder counts]."""
    return encode_positions((counts,))[0]


def encode_positions(counts: Sequence[int]) -> list[bytes]:
    """Return a three-byte payload per motor position, wrapped at 22 bits."""
    return [(count % POSITION_MODULUS).to_bytes(3, "big") for count in counts]


def decode_position(data: Payload) -> int:
    """Return the motor position [encoder counts] of a position reply.

    The second half of a six-byte reply is the joint encoder: `decode_joint_encoder`.

    Raises:
        FrameError: not 3 or 6 bytes.
    """
    if len(data) not in (3, 6):
        raise FrameError("Not a position reply", data)
    # libbarrett ignores the two bits above the 22, too.
    counts = int.from_bytes(data[:3], "big") & _POSITION_MASK
    return (counts ^ _POSITION_SIGN) - _POSITION_SIGN


def decode_joint_encoder(data: Payload) -> int | None:
    """Return the joint encoder position [counts] of a position reply, or None.

    Raises:
        FrameError: as `decode_position`.
    """
    if len(data) == 3:
        return None
    return decode_position(data[3:])


def encode_torques(units: Sequence[float], number: int = 42) -> bytes:
    """Return the packed torque frame of one group.

    Each value is clipped to ±8191 and rounded down, as libbarrett does: the caller
    rounds to nearest where a bias of half a unit matters.

    Args:
        units: three or four torques [puck units]; a missing fourth is 0.
        number: number of property T in the pucks' firmware.
    """
    word = 0x80 | number
    for value in units:
        clipped = value
        if not -TORQUE_LIMIT <= value <= TORQUE_LIMIT:
            clipped = min(max(value, -TORQUE_LIMIT), TORQUE_LIMIT)
        word = word << 14 | floor(clipped) & 0x3FFF
    if len(units) == 3:
        word <<= 14
    return word.to_bytes(8, "big")


def decode_torques(data: Payload) -> tuple[int, int, int, int]:
    """Return the four torques [puck units] of a packed frame, in the order of PIDX.

    Raises:
        FrameError: not eight bytes, or not a SET.
    """
    if len(data) != 8 or not data[0] & 0x80:
        raise FrameError("Not a packed torque frame", data)
    word = int.from_bytes(data[1:], "big") ^ TORQUE_SIGNS
    return (
        (word >> 42 & 0x3FFF) - 0x2000,
        (word >> 28 & 0x3FFF) - 0x2000,
        (word >> 14 & 0x3FFF) - 0x2000,
        (word & 0x3FFF) - 0x2000,
    )


Triple = tuple[float, float, float]


def encode_force(force: Triple) -> bytes:
    """Return the payload of a force [N], clipped to ±128 N."""
    return _encode_triple(force, _FORCE_PER_N)


def decode_force(data: Payload) -> Triple:
    """Return the force [N] of a force frame; a seventh byte is ignored.

    Raises:
        FrameError: neither 6 nor 7 bytes.
    """
    if len(data) not in (6, 7):
        raise FrameError("Not a force frame", data)
    return _decode_triple(data[:6], _FORCE_PER_N)


def encode_torque(torque: Triple, status: int | None = None) -> bytes:
    """Return the payload of a torque [N m], with `status` as an optional 7th byte."""
    tail = b"" if status is None else bytes((status,))
    return _encode_triple(torque, _TORQUE_PER_NM) + tail


def decode_torque(data: Payload) -> tuple[Triple, int]:
    """Return torque [N m] and status byte; 0 = no fault.

    Status: bit 7 = tare required, bit 6 = invalid data, bits 5..0 = gauges saturated
    since the last tare.

    Raises:
        FrameError: neither 6 nor 7 bytes.
    """
    if len(data) not in (6, 7):
        raise FrameError("Not a torque frame of the sensor", data)
    status = data[6] if len(data) == 7 else 0
    return _decode_triple(data[:6], _TORQUE_PER_NM), status


def encode_acceleration(acceleration: Triple) -> bytes:
    """Return the payload of the sensor's acceleration [m/s²], scale unverified."""
    return _encode_triple(acceleration, _ACCELERATION_SCALE)


def decode_acceleration(data: Payload) -> Triple:
    """Return the acceleration [m/s²]; FrameError unless the frame has 6 bytes."""
    if len(data) != 6:
        raise FrameError("Not an acceleration frame", data)
    return _decode_triple(data, _ACCELERATION_SCALE)


def _encode_triple(values: Triple, scale: float) -> bytes:
    clipped = (min(max(round(v * scale), -0x8000), 0x7FFF) for v in values)
    return struct.pack("<3h", *clipped)


def _decode_triple(data: Payload, scale: float) -> Triple:
    x, y, z = struct.unpack("<3h", data)
    return x / scale, y / scale, z / scale
