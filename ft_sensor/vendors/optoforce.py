"""Codec of the serial protocol of OptoForce / OnRobot HEX 6-axis sensors; no I/O.

A data frame has 22 bytes: header AA 07 08 10, 16-bit counter, status, six counts and
a checksum (16-bit sum), all big-endian. The scale differs from unit to unit: the
sensitivity report of the unit gives six sensitivities.
"""

import struct
from dataclasses import dataclass

from ft_sensor.reading import Reading, Wrench, axis_names
from ft_sensor.serial_line.framing import FrameScanner

HEADER = bytes((0xAA, 0x07, 0x08, 0x10))
FRAME_SIZE = 22
COUNTER_MODULUS = 1 << 16
SPEED_CODES = {1000: 1, 333: 3, 100: 10, 30: 33, 10: 100}
STOPPED = 0
FILTER_CODES = {0: 0, 500: 1, 150: 2, 50: 3, 15: 4, 5: 5}
ASK_SERIAL = bytes((0xAB, 0x00, 0x12, 0x08, 0x00, 0xC5))
FULL_COUNTS = 32000  # full scale; larger counts are saturated

_CONFIGURATION = bytes((0xAA, 0x00, 0x32, 0x03))
_ANSWER = bytes((0xAA, 0x00, 0x50, 0x01))
_SERIAL = bytes((0xAA, 0x00, 0x12, 0x08))
_BODY = struct.Struct(">HH6h")
_SUM = struct.Struct(">H")
_OVERLOADED = 0x03F0
_BROKEN = 0xFC00
_OLD_FRAMES = tuple(bytes((55, kind)) for kind in (66, 67, 68, 94))
_DAQ_WORDS = {1: "DAQ error", 2: "DAQ communication error"}
_SENSOR_WORDS = {1: "sensor not detected", 2: "sensor failure", 4: "temperature error"}


@dataclass(frozen=True, slots=True)
class OptoForceFrame:
    """One measurement as transmitted.

    Attributes:
        counter: frame counter, wraps at 65536.
        status: see `status_texts`.
        counts: fx fy fz tx ty tz as sent, 16 bits each.
    """

    counter: int
    status: int
    counts: tuple[int, int, int, int, int, int]


def _summed(data: bytes) -> bytes:
    return data + _SUM.pack(sum(data) & 0xFFFF)


def _is_summed(data: bytes) -> bool:
    return sum(data[:-2]) & 0xFFFF == _SUM.unpack(data[-2:])[0]


def encode_frame(frame: OptoForceFrame) -> bytes:
    """Return the 22 bytes of `frame`.

    Raises:
        struct.error: a number does not fit 16 bits.
    """
    return _summed(HEADER + _BODY.pack(frame.counter, frame.status, *frame.counts))


def decode_frame(data: bytes, start: int = 0) -> OptoForceFrame | None:
    """Return the frame in the 22 bytes from `start`; None if they are not one."""
    whole = data[start : start + FRAME_SIZE]
    if len(whole) != FRAME_SIZE or not whole.startswith(HEADER):
        return None
    if not _is_summed(whole):
        return None
    counter, status, fx, fy, fz, tx, ty, tz = _BODY.unpack_from(whole, len(HEADER))
    return OptoForceFrame(counter, status, (fx, fy, fz, tx, ty, tz))


def encode_configuration(speed: int, low_pass: int, zero: int = 0) -> bytes:
    """Return the 9 bytes that set speed and filter, by their codes.

    `zero`: 255 stores the present load as offset, 0 clears the stored offset.
    """
    return _summed(_CONFIGURATION + bytes((speed, low_pass, zero)))


def decode_configuration(data: bytes) -> tuple[int, int, int] | None:
    """Return (speed, filter, zero) of a configuration; None if it is not one."""
    if len(data) != 9 or not data.startswith(_CONFIGURATION) or not _is_summed(data):
        return None
    return data[4], data[5], data[6]


def encode_configuration_answer(code: int) -> bytes:
    """Return the 7 bytes that answer a configuration; 0 = accepted."""
    return _summed(_ANSWER + bytes((code,)))


def find_configuration_answer(data: bytes) -> int | None:
    """Return the code of the newest reply in `data`, or None."""
    answer = _newest_reply(data, _ANSWER, 7)
    return None if answer is None else answer[4]


def encode_serial_number(name: str) -> bytes:
    """Return the 14-byte reply to a request for the serial number."""
    return _summed(_SERIAL + name.encode("ascii").ljust(8, b"\0")[:8])


def find_serial_number(data: bytes) -> str | None:
    """Return the serial number in `data`; None if there is none."""
    answer = _newest_reply(data, _SERIAL, 14)
    if answer is None:
        return None
    return answer[4:12].split(b"\0")[0].decode("ascii", errors="replace").strip()


def _newest_reply(data: bytes, header: bytes, size: int) -> bytes | None:
    start = data.rfind(header)
    while start >= 0:
        answer = data[start : start + size]
        if len(answer) == size and _is_summed(answer):
            return answer
        start = data.rfind(header, 0, start + len(header) - 1)
    return None


def is_older_protocol(data: bytes) -> bool:
    """Return whether `data` looks like the stream of an older protocol."""
    return sum(data.count(begin) for begin in _OLD_FRAMES) >= 8


def overloaded_axes(status: int) -> int:
    """Return the overloaded axes, bit 0 = Fx; on the wire Fx is bit 9."""
    return sum(1 << axis for axis in range(6) if status >> (9 - axis) & 1)


def status_texts(status: int) -> tuple[str, ...]:
    """Return the meaning of a status: state of DAQ and sensor, overloaded axes."""
    daq, sensor = status >> 13 & 0x7, status >> 10 & 0x7
    words: list[str] = []
    if daq:
        words.append(_DAQ_WORDS.get(daq, f"DAQ state {daq}"))
    if sensor:
        words.append(_SENSOR_WORDS.get(sensor, f"sensor state {sensor}"))
    words += [f"{axis} overloaded" for axis in axis_names(overloaded_axes(status))]
    return tuple(words)


def scanner(sensitivity: Wrench) -> FrameScanner[Reading]:
    """Return a scanner for frames of a unit with `sensitivity` [counts/N, /N m]."""
    gains = tuple(1.0 / value for value in sensitivity)

    def read(data: bytes, start: int) -> Reading | None:
        frame = decode_frame(data, start)
        if frame is None:
            return None
        fx, fy, fz, tx, ty, tz = frame.counts
        gx, gy, gz, hx, hy, hz = gains
        wrench = (fx * gx, fy * gy, fz * gz, tx * hx, ty * hy, tz * hz)
        status = frame.status
        beyond = overloaded_axes(status) if status & _OVERLOADED else 0
        for axis, count in enumerate(frame.counts):
            if not -FULL_COUNTS < count < FULL_COUNTS:
                beyond |= 1 << axis
        is_trusted = not status & _BROKEN
        return Reading(frame.counter, wrench, status, is_trusted, beyond)

    return FrameScanner(HEADER, FRAME_SIZE, read)
