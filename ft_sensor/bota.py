"""The serial protocol of the Bota sensors of generation 1, without any I/O.

One frame is 37 bytes: header 0xAA, status, three forces, three torques, the device's
own microseconds, a temperature and a CRC-16/X-25 over bytes 1 to 34. Commands are
short ASCII strings without an end mark; the device acknowledges each with
``r,<digit>,<letter>,<code>``, code 0 meaning accepted.
"""

import re
import struct
from binascii import crc_hqx
from dataclasses import dataclass
from enum import IntFlag

Wrench = tuple[float, float, float, float, float, float]

HEADER = 0xAA
FRAME_SIZE = 37
BITS_PER_BYTE = 10  # 8N1: a start bit, eight data bits, a stop bit
SINC_STEP_NS = 19_531.25  # output period per unit of sinc length
BAUD_CODES = {9600: 0, 57600: 1, 115200: 2, 230400: 3, 460800: 4}
MAX_COMMAND_SIZE = 64  # the device's input buffer

CONFIGURE = b"C"
RUN = b"R"
SOFT_RESET = b"I"
HARD_RESET = b"#"

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


_WORDS = {
    BotaStatus.SKIPPED: "measurements skipped: sinc length too short",
    BotaStatus.OVER_RANGE: "measuring range exceeded",
    BotaStatus.INVALID: "measurements invalid: saturated, short or open circuit",
    BotaStatus.RAW_GAUGE: "raw gauge data: calibration matrix not applied",
}


def status_words(status: int) -> tuple[str, ...]:
    """Return what the set bits of `status` say, lowest bit first."""
    words = [text for bit, text in _WORDS.items() if status & bit]
    reserved = status & ~sum(_WORDS)
    if reserved:
        words.append(f"reserved bits 0x{reserved:04x}")
    return tuple(words)


@dataclass(frozen=True, slots=True)
class BotaFrame:
    """One measurement as it was on the wire.

    Attributes:
        status: status bits, see `BotaStatus`.
        wrench: fx fy fz tx ty tz in the sensor frame [N, N m].
        device_us: the device's clock, wraps at 2**32 [us].
        temperature: inside the sensor [degrees Celsius].
    """

    status: int
    wrench: Wrench
    device_us: int
    temperature: float


def crc_x25(data: bytes) -> int:
    """Return the CRC-16/X-25 of `data`.

    X-25 is the bit-reversed twin of the CRC of `binascii.crc_hqx`: reversing the bits
    of every byte going in and of the result coming out turns one into the other.
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
    """Return the frame in the 37 bytes from `start`; None if they are not one.

    Data followed by its own checksum always leaves the same residue, so the stored
    checksum is not compared but run through.
    """
    checked = data[start + 1 : start + FRAME_SIZE]
    if len(checked) != FRAME_SIZE - 1 or data[start] != HEADER:
        return None
    if crc_hqx(checked.translate(_REVERSED_BITS), _CRC_START) != _GOOD_RESIDUE:
        return None
    _, status, fx, fy, fz, tx, ty, tz, device_us, temperature, _ = _FRAME.unpack_from(
        data, start
    )
    return BotaFrame(status, (fx, fy, fz, tx, ty, tz), device_us, temperature)


@dataclass(slots=True)
class ParserCounters:
    """What a parser has met so far.

    Attributes:
        frames: good frames.
        crc_errors: header bytes whose 37 bytes failed the checksum; one damaged frame
            counts once for every 0xAA in it.
        discarded: bytes that belong to no good frame.
        resyncs: times the stream was lost.
    """

    frames: int = 0
    crc_errors: int = 0
    discarded: int = 0
    resyncs: int = 0


class BotaParser:
    """Finds frames in a byte stream that may be damaged anywhere.

    After a failed checksum the search goes on one byte later, so that one damaged
    byte costs one frame. Between calls it holds less than one frame.
    """

    def __init__(self) -> None:
        self.counters = ParserCounters()
        self._held = b""
        self._is_lost = False

    def feed(self, data: bytes) -> list[BotaFrame]:
        """Return the frames completed by `data`, oldest first."""
        frames: list[BotaFrame] = []
        start = 0
        if self._held:
            # A frame that begins in the held bytes ends within the next 36.
            held = len(self._held)
            seam = self._held + data[: FRAME_SIZE - 1]
            reached = self._scan(seam, 0, held, frames)
            if reached < held:
                self._held = seam[reached:]
                return frames
            start = reached - held
        self._held = data[self._scan(data, start, len(data), frames) :]
        return frames

    def _scan(self, data: bytes, start: int, stop: int, frames: list[BotaFrame]) -> int:
        """Collect the frames that begin in [start, stop); return where to go on."""
        counters = self.counters
        while start < stop:
            header = data.find(HEADER, start, stop)
            if header != start:
                header = stop if header < 0 else header
                self._discard(header - start)
                start = header
                continue
            if len(data) - start < FRAME_SIZE:
                break
            frame = decode_frame(data, start)
            if frame is None:
                counters.crc_errors += 1
                self._discard(1)
                start += 1
            else:
                frames.append(frame)
                counters.frames += 1
                self._is_lost = False
                start += FRAME_SIZE
        return start

    def _discard(self, count: int) -> None:
        self.counters.discarded += count
        if not self._is_lost:
            self._is_lost = True
            self.counters.resyncs += 1


def unwrap_us(device_us: int, last_us: int) -> int:
    """Return the time [us] nearest to `last_us` that the 32-bit clock shows so."""
    half = 1 << 31
    return last_us + (device_us - last_us + half) % (1 << 32) - half


def frame_period_ns(sinc: int) -> float:
    """Return the output period [ns] at a sinc length: rate = 51200 / sinc Hz."""
    return sinc * SINC_STEP_NS


def wire_time_ns(size: int, baudrate: int) -> int:
    """Return how long `size` bytes occupy the wire [ns]."""
    return size * BITS_PER_BYTE * 1_000_000_000 // baudrate


def communication_command(baudrate: int) -> bytes:
    """Return the command for calibrated binary output at `baudrate` (in BAUD_CODES)."""
    return b"c,0,1,0,%d" % BAUD_CODES[baudrate]


def filter_command(sinc: int, is_fir_on: bool) -> bytes:
    """Return the command for a sinc length, chop and fast mode off."""
    return b"f,%d,0,0,%d" % (sinc, not is_fir_on)


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """The device's answer to the command that begins with `letter`; 0 = accepted."""

    letter: str
    code: int


def encode_acknowledgement(answer: Acknowledgement) -> bytes:
    """Return the bytes of `answer`."""
    return b"r,0,%s,%d" % (answer.letter.encode("ascii"), answer.code)


def find_acknowledgements(data: bytes) -> list[Acknowledgement]:
    """Return the acknowledgements in `data`, which may be binary around them."""
    return [
        Acknowledgement(found[1].decode("ascii"), int(found[2][:9]))
        for found in _ACKNOWLEDGEMENT.finditer(data)
    ]


@dataclass(frozen=True, slots=True)
class BootText:
    """What the device says of itself after power-on; empty where it did not."""

    is_started: bool = False
    name: str = ""
    serial_number: str = ""
    firmware: str = ""

    @property
    def is_complete(self) -> bool:
        """The last line has arrived."""
        return bool(self.firmware)


def find_boot_text(data: bytes) -> BootText:
    """Return the known tokens in `data`; text around them is not documented."""

    def line(pattern: re.Pattern[bytes]) -> str:
        found = pattern.search(data)
        return found[1].decode("ascii").strip() if found else ""

    return BootText(b"App Init" in data, line(_NAME), line(_SERIAL), line(_FIRMWARE))


def encode_boot_text(text: BootText) -> bytes:
    """Return `text` as a device prints it."""
    lines = (
        "App Init",
        f"name: {text.name}",
        f"S/N: {text.serial_number}",
        f"FW version: {text.firmware}",
    )
    return "".join(f"{line}\r\n" for line in lines).encode("ascii")
