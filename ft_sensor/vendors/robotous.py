"""Codec of the serial protocol of Robotous RFT sensors; no I/O.

A packet begins with 0x55 and ends with a checksum, the 8-bit sum of its data, and 0xAA.
Commands have eight data bytes, replies and samples sixteen, the first of which repeats
the command. A sample has six big-endian counts and one overload bit per axis, but no
counter and no clock.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

from ft_sensor.reading import Reading, Wrench, axis_names
from ft_sensor.serial_line.framing import FrameScanner

FRAME_SIZE = 19
COMMAND_SIZE = 11
SOP, EOP = 0x55, 0xAA
FORCE_COUNTS = 50.0  # counts per newton, all models

MODEL, SERIAL, FIRMWARE = 0x01, 0x02, 0x03
SET_BAUDRATE, SET_FILTER, GET_FILTER = 0x06, 0x08, 0x09
SAMPLE, STREAM, STOP = 0x0A, 0x0B, 0x0C
SET_RATE, GET_RATE = 0x0F, 0x10
BIAS, OVERLOADS = 0x11, 0x12

BAUD_CODES = {115200: 4, 921600: 1, 460800: 2, 230400: 3, 57600: 5}
RATE_CODES = {200: 0, 10: 1, 20: 2, 50: 3, 100: 4, 333: 6, 500: 7, 1000: 8}
# Order of the manual; the maker's C header has the opposite order.
FILTER_CODES = {500: 1, 300: 2, 200: 3, 150: 4, 100: 5, 50: 6, 40: 7, 30: 8}
ERRORS = {1: "not supported", 2: "out of range", 3: "could not be stored"}

_COUNTS = struct.Struct(">6h")


@dataclass(frozen=True, slots=True)
class RobotousModel:
    """Ranges and scale of a model.

    Attributes:
        ranges: rated load fx fy fz tx ty tz [N, N m].
        torque_counts: counts per newton metre.
        most_hz: fastest output [Hz].
    """

    ranges: Wrench
    torque_counts: float
    most_hz: int = 1000


def _rated(fxy: float, fz: float, torque: float) -> Wrench:
    return (fxy, fxy, fz, torque, torque, torque)


MODELS = {
    "RFT40-SA01": RobotousModel(_rated(100.0, 150.0, 2.5), 2000.0, most_hz=200),
    "RFT44-SB01": RobotousModel(_rated(100.0, 150.0, 2.5), 2000.0, most_hz=200),
    "RFT60-HA01": RobotousModel(_rated(150.0, 200.0, 4.0), 2000.0),
    "RFT64-SB01": RobotousModel(_rated(150.0, 200.0, 4.0), 2000.0),
    "RFT76-HA01": RobotousModel(_rated(300.0, 300.0, 10.0), 2000.0),
    "RFT82-HA02": RobotousModel(_rated(400.0, 400.0, 20.0), 1000.0),
    "RFT80-6A01": RobotousModel(_rated(400.0, 400.0, 20.0), 1000.0),
}


@dataclass(frozen=True, slots=True)
class RobotousFrame:
    """One measurement as transmitted.

    Attributes:
        counts: fx fy fz tx ty tz as sent, 16 bits each.
        overload: bits 5 to 0: fx fy fz tx ty tz more than 20 % above rated load.
    """

    counts: tuple[int, int, int, int, int, int]
    overload: int


def encode_command(command: int, *parameters: int) -> bytes:
    """Return the 11 bytes of `command` with up to seven parameter bytes."""
    data = bytes((command, *parameters)).ljust(8, b"\0")
    return _packed(data)


def encode_answer(command: int, *content: int) -> bytes:
    """Return the 19-byte reply to `command`, with up to 15 bytes of content."""
    return _packed(bytes((command, *content)).ljust(16, b"\0"))


def encode_frame(frame: RobotousFrame, command: int = STREAM) -> bytes:
    """Return the 19 bytes of a sample.

    Raises:
        struct.error: a count does not fit 16 bits.
    """
    return encode_answer(command, *_COUNTS.pack(*frame.counts), frame.overload)


def _packed(data: bytes) -> bytes:
    return b"\x55" + data + bytes((sum(data) & 0xFF, EOP))


def is_packet(data: bytes, start: int = 0) -> bool:
    """Return whether the 19 bytes from `start` are a valid reply or sample."""
    return (
        len(data) - start >= FRAME_SIZE
        and data[start] == SOP
        and data[start + 18] == EOP
        and sum(data[start + 1 : start + 17]) & 0xFF == data[start + 17]
    )


def decode_frame(data: bytes, start: int = 0) -> RobotousFrame | None:
    """Return the streamed sample in the 19 bytes from `start`, or None."""
    if not is_packet(data, start) or data[start + 1] != STREAM:
        return None
    fx, fy, fz, tx, ty, tz = _COUNTS.unpack_from(data, start + 2)
    return RobotousFrame((fx, fy, fz, tx, ty, tz), data[start + 14])


def decode_command(data: bytes) -> tuple[int, bytes] | None:
    """Return (command, seven parameter bytes) of a command packet, or None."""
    if len(data) != COMMAND_SIZE or data[0] != SOP or data[10] != EOP:
        return None
    if sum(data[1:9]) & 0xFF != data[9]:
        return None
    return data[1], data[2:9]


def find_answer(data: bytes, command: int) -> bytes | None:
    """Return the 15 content bytes of the newest reply to `command`, or None."""
    begin = bytes((SOP, command))
    start = data.rfind(begin)
    while start >= 0 and not is_packet(data, start):
        start = data.rfind(begin, 0, start + 1)
    return data[start + 2 : start + 17] if start >= 0 else None


def text_of(content: bytes) -> str:
    """Return the text in a reply's content."""
    return content.split(b"\0")[0].decode("ascii", errors="replace").strip()


def overloaded_axes(overload: int) -> int:
    """Return the overloaded axes, bit 0 = Fx; on the wire Fx is bit 5."""
    return sum(1 << axis for axis in range(6) if overload >> (5 - axis) & 1)


def status_texts(status: int) -> tuple[str, ...]:
    """Return the meanings of the overload bits of a sample."""
    axes = axis_names(overloaded_axes(status))
    return tuple(f"{axis} more than 20 % above rated load" for axis in axes)


def scanner(torque_counts: Callable[[], float]) -> FrameScanner[Reading]:
    """Return a scanner for samples; `torque_counts` gives the counts per N m."""

    def read(data: bytes, start: int) -> Reading | None:
        frame = decode_frame(data, start)
        if frame is None:
            return None
        fx, fy, fz, tx, ty, tz = frame.counts
        newtons, newton_metres = 1.0 / FORCE_COUNTS, 1.0 / torque_counts()
        wrench = (
            fx * newtons,
            fy * newtons,
            fz * newtons,
            tx * newton_metres,
            ty * newton_metres,
            tz * newton_metres,
        )
        overload = frame.overload & 0x3F
        beyond = overloaded_axes(overload) if overload else 0
        return Reading(0, wrench, overload, True, beyond)

    return FrameScanner(b"\x55", FRAME_SIZE, read)
