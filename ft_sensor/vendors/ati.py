"""RDT, the protocol of ATI's network sensors (Net F/T, Ethernet Axia) over UDP.

A request has 8 bytes: 0x1234, command, number of samples; a record has 36: number of
the packet, number of the measurement, status, and six counts, all of them big-endian.
Counts become newtons and newton metres by the two scales of the sensor's own web page.
"""

import struct
from dataclasses import dataclass

from ft_sensor.reading import ALL_AXES, Reading, Wrench, axes_beyond
from ft_sensor.serial_line.framing import FrameScanner

PORT = 49152
FRAME_SIZE = 36
STOP, STREAM = 0x0000, 0x0002
MODULUS = 1 << 32  # of both numbers
LATE = 1000  # packets behind the newest that came late or twice; further back: restart
_REQUEST = struct.Struct(">HHI")
_RECORD = struct.Struct(">III6i")
_MARK = 0x1234
_ERROR = 1 << 31  # set with every failure
_SATURATED = 1 << 17
_LATCHED = 1 << 16  # a monitor condition of the user's own: no failure
_NOT_BROKEN = _ERROR | _SATURATED | _LATCHED
_WORDS = {
    31: "error",
    17: "transducer saturated",
    16: "monitor condition latched",
}


@dataclass(frozen=True, slots=True)
class RdtRecord:
    """One record.

    Attributes:
        number: of the packet since the stream was started.
        measurement: number of the measurement in the sensor.
        status: 32 bits; 0 = well.
        counts: fx fy fz tx ty tz.
    """

    number: int
    measurement: int
    status: int
    counts: tuple[int, int, int, int, int, int]


def encode_request(command: int, count: int = 0) -> bytes:
    """Return a request; a `count` of 0 is without end."""
    return _REQUEST.pack(_MARK, command, count)


def decode_request(data: bytes) -> tuple[int, int] | None:
    """Return command and count of a request; None where it is none."""
    if len(data) != _REQUEST.size:
        return None
    mark, command, count = _REQUEST.unpack(data)
    return (command, count) if mark == _MARK else None


def encode_record(record: RdtRecord) -> bytes:
    """Return the 36 bytes of a record."""
    return _RECORD.pack(
        record.number, record.measurement, record.status, *record.counts
    )


def decode_record(data: bytes, start: int = 0) -> RdtRecord:
    """Return the record that begins at `start`."""
    number, measurement, status, *counts = _RECORD.unpack_from(data, start)
    fx, fy, fz, tx, ty, tz = counts
    return RdtRecord(number, measurement, status, (fx, fy, fz, tx, ty, tz))


def status_words(status: int) -> tuple[str, ...]:
    """Return what the set bits of a status say; by number where no name is known."""
    bits = (bit for bit in range(31, -1, -1) if status >> bit & 1)
    return tuple(_WORDS.get(bit, f"failure, bit {bit}") for bit in bits)


class RdtScanner(FrameScanner[Reading]):
    """Records in the order of their numbers, each once.

    Packets that overtook each other within one read are put in order. One that comes
    after a newer one was handed over, and one that comes twice, are dropped; the loss
    of the former is counted by the numbers.

    Attributes:
        late: records dropped because a newer one or the same one had come.
    """

    def __init__(self, counts: Wrench, ranges: Wrench) -> None:
        """Take counts per N and N m, and what is measured at most [N, N m]."""
        self.late = 0
        self._gains = tuple(1.0 / value for value in counts)
        self._ranges = ranges
        self._newest: int | None = None
        super().__init__(b"", FRAME_SIZE, self._read)

    def feed(self, data: bytes) -> list[Reading]:
        """Return the records completed by `data` that are newer than all before."""
        return self._in_order(super().feed(data))

    def _read(self, data: bytes, start: int) -> Reading:
        record = decode_record(data, start)
        fx, fy, fz, tx, ty, tz = record.counts
        gx, gy, gz, hx, hy, hz = self._gains
        wrench = (fx * gx, fy * gy, fz * gz, tx * hx, ty * hy, tz * hz)
        saturated = axes_beyond(wrench, self._ranges)
        if record.status & _SATURATED:
            saturated = ALL_AXES  # it says that, not where
        broken = record.status & ~_NOT_BROKEN
        is_error = bool(record.status & _ERROR) and not record.status & _SATURATED
        is_trusted = not broken and not is_error
        return Reading(record.number, wrench, record.status, is_trusted, saturated)

    def _in_order(self, readings: list[Reading]) -> list[Reading]:
        if not readings:
            return readings
        start = self._newest
        if start is None:
            start = (readings[0].ticks - 1) % MODULUS
        ahead = [_ahead(reading.ticks, start) for reading in readings]
        is_restarted = min(ahead) < -LATE
        if is_restarted:  # its numbers began anew: whoever dates them sees a jump
            self._newest = readings[-1].ticks
            return readings
        fresh: list[Reading] = []
        last = 0
        for step, reading in sorted(
            zip(ahead, readings, strict=True), key=lambda pair: pair[0]
        ):
            if step > last:
                fresh.append(reading)
                last = step
            else:
                self.late += 1
        self._newest = (start + last) % MODULUS
        return fresh


def _ahead(number: int, start: int) -> int:
    """Return by how much a number is ahead of another one, across the wrap."""
    half = MODULUS // 2
    return (number - start + half) % MODULUS - half
