"""Codec of the serial protocol of Bota sensors of generation 1; no I/O.

A frame has 37 bytes: header 0xAA, status, three forces, three torques, device clock in
microseconds, temperature and a CRC-16/X-25 over bytes 1 to 34. Commands are short ASCII
strings without a terminator; the device acknowledges each with
``r,<digit>,<letter>,<code>``, code 0 meaning accepted.
"""

import re
import struct
from binascii import crc_hqx
from dataclasses import dataclass
from enum import IntFlag
from functools import partial
from typing import NamedTuple

from ft_sensor.reading import ALL_AXES, Reading, Wrench, axes_beyond
from ft_sensor.serial_line.framing import FrameScanner

HEADER = 0xAA
FRAME_SIZE = 37
CLOCK_MODULUS = 1 << 32  # us
SINC_STEP_NS = 19_531.25  # output period per unit of sinc length
BAUD_CODES = {9600: 0, 57600: 1, 115200: 2, 230400: 3, 460800: 4}
MAX_COMMAND_SIZE = 64  # the device's input buffer

CONFIGURE = b"C"
RUN = b"R"
SOFT_RESET = b"I"

_FRAME = struct.Struct("<BH6fIfH")
_BODY = struct.Struct("<H6fIf")  # what the checksum covers
_REVERSED_BITS = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_CRC_START = 0xFFFF
_GOOD_RESIDUE = 0x1D0F  # 0x0F47, complemented and bit-reversed
_ACKNOWLEDGEMENT = re.compile(rb"r,\d,([A-Za-z]),(-?\d+)")
_BOOT_LINE = rb"%s:[ \t]*([\x20-\x7e]{1,64})[\r\n]"
_NAME, _SERIAL, _FIRMWARE = (
    re.compile(_BOOT_LINE % word) for word in (b"name", b"S/N", b"FW version")
)


class BotaStatus(IntFlag):
    """Status bits of a frame; the twelve other bits are reserved."""

    SKIPPED = 0x1
    OVER_RANGE = 0x2
    INVALID = 0x4
    RAW_GAUGE = 0x8


_OVER_RANGE = int(BotaStatus.OVER_RANGE)
_UNTRUSTED = int(BotaStatus.INVALID | BotaStatus.RAW_GAUGE)
_WORDS = {
    BotaStatus.SKIPPED: "measurements skipped: sinc length too short",
    BotaStatus.OVER_RANGE: "measuring range exceeded",
    BotaStatus.INVALID: "measurements invalid: saturated, short or open circuit",
    BotaStatus.RAW_GAUGE: "raw gauge data: calibration matrix not applied",
}


def status_texts(status: int) -> tuple[str, ...]:
    """Return the meanings of the set bits of `status`, lowest bit first."""
    words = [text for bit, text in _WORDS.items() if status & bit]
    reserved = status & ~sum(_WORDS)
    if reserved:
        words.append(f"reserved bits 0x{reserved:04x}")
    return tuple(words)


class BotaFrame(NamedTuple):
    """One measurement as on the wire; a tuple for speed.

    Attributes:
        status: status bits, see `BotaStatus`.
        wrench: fx fy fz tx ty tz in the sensor frame [N, N m].
        device_us: device clock, wraps at 2**32 [us].
        temperature: temperature inside the sensor [degrees Celsius].
    """

    status: int
    wrench: Wrench
    device_us: int
    temperature: float


# Skips NamedTuple's __new__, which takes longer than decoding the frame.
_as_frame = partial(tuple[int | float | Wrench].__new__, BotaFrame)


def crc_x25(data: bytes) -> int:
    """Return the CRC-16/X-25 of `data`.

    X-25 is the reflected form of the CRC of `binascii.crc_hqx`: reversing the bits of
    every input byte and of the result converts one to the other.
    """
    crc = crc_hqx(data.translate(_REVERSED_BITS), _CRC_START)
    return (_REVERSED_BITS[crc & 0xFF] << 8 | _REVERSED_BITS[crc >> 8]) ^ 0xFFFF


def encode_frame(frame: BotaFrame) -> bytes:
    """Return the 37 bytes of `frame`.

    Raises:
        struct.error: status or device time do not fit their fields.
        OverflowError: a number does not fit a 32-bit float.
    """
    body = _BODY.pack(frame.status, *frame.wrench, frame.device_us, frame.temperature)
    return b"\xaa" + body + crc_x25(body).to_bytes(2, "little")


def decode_frame(data: bytes, start: int = 0) -> BotaFrame | None:
    """Verify the CRC of 37 bytes from `start` and return their frame, or None.

    The CRC over data and checksum has a constant residue, so the checksum need not be
    extracted and compared.
    """
    checked = data[start + 1 : start + FRAME_SIZE]
    if len(checked) != FRAME_SIZE - 1 or data[start] != HEADER:
        return None
    if crc_hqx(checked.translate(_REVERSED_BITS), _CRC_START) != _GOOD_RESIDUE:
        return None
    _, status, fx, fy, fz, tx, ty, tz, device_us, temperature, _ = _FRAME.unpack_from(
        data, start
    )
    return _as_frame((status, (fx, fy, fz, tx, ty, tz), device_us, temperature))


def scanner(ranges: Wrench) -> FrameScanner[Reading]:
    """Return a scanner for the frames of a sensor with these `ranges` [N, N m]."""

    def read(data: bytes, start: int) -> Reading | None:
        frame = decode_frame(data, start)
        if frame is None:
            return None
        status, wrench, device_us, _ = frame
        if not status:
            return Reading(device_us, wrench, 0, True, 0)
        beyond = 0
        if status & _OVER_RANGE:  # the device does not report the axis
            beyond = axes_beyond(wrench, ranges) or ALL_AXES
        is_trusted = not status & _UNTRUSTED
        return Reading(device_us, wrench, status, is_trusted, beyond)

    return FrameScanner(b"\xaa", FRAME_SIZE, read)


def frame_period_ns(sinc: int) -> float:
    """Return the output period [ns] at a sinc length: rate = 51200 / sinc Hz."""
    return sinc * SINC_STEP_NS


def communication_command(baudrate: int) -> bytes:
    """Return the command for calibrated binary output at `baudrate` (in BAUD_CODES)."""
    return b"c,0,1,0,%d" % BAUD_CODES[baudrate]


def filter_command(sinc: int, is_fir_on: bool) -> bytes:
    """Return the command for a sinc length, chop and fast mode off."""
    return b"f,%d,0,0,%d" % (sinc, not is_fir_on)


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """The device's reply to the command beginning with `letter`; code 0 = accepted."""

    letter: str
    code: int


def encode_acknowledgement(answer: Acknowledgement) -> bytes:
    """Return the bytes of `answer`."""
    return b"r,0,%s,%d" % (answer.letter.encode("ascii"), answer.code)


def find_acknowledgements(data: bytes) -> list[Acknowledgement]:
    """Return the acknowledgements in `data`, possibly embedded in binary frames."""
    return [
        Acknowledgement(match[1].decode("ascii"), int(match[2][:9]))
        for match in _ACKNOWLEDGEMENT.finditer(data)
    ]


@dataclass(frozen=True, slots=True)
class BootText:
    """Boot message of the device; "" for missing fields."""

    is_started: bool = False
    name: str = ""
    serial_number: str = ""
    firmware: str = ""

    @property
    def is_complete(self) -> bool:
        """Whether the last line has been received."""
        return bool(self.firmware)


def find_boot_text(data: bytes) -> BootText:
    """Return the known fields in `data`; the text around them is undocumented."""

    def line(pattern: re.Pattern[bytes]) -> str:
        match = pattern.search(data)
        return match[1].decode("ascii").strip() if match else ""

    return BootText(b"App Init" in data, line(_NAME), line(_SERIAL), line(_FIRMWARE))


def encode_boot_text(text: BootText) -> bytes:
    """Return the boot message as a device sends it."""
    lines = (
        "App Init",
        f"name: {text.name}",
        f"S/N: {text.serial_number}",
        f"FW version: {text.firmware}",
    )
    return "".join(f"{line}\r\n" for line in lines).encode("ascii")
