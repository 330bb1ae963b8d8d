"""RDT, the protocol of ATI's network sensors (Net F/T, Ethernet Axia) over UDP.

A request has 8 bytes: 0x1234, command, number of samples. A record has 36: RDT sequence
number, F/T sequence number, status, six counts; all big-endian. Counts are converted to
N and N m with the two scales given on the sensor's web page.
"""

import struct
from dataclasses import dataclass

from ft_sensor.reading import ALL_AXES, Reading, Wrench, axes_beyond
from ft_sensor.serial_line.framing import FrameScanner

PORT = 49152
FRAME_SIZE = 36
STOP, STREAM = 0x0000, 0x0002
MODULUS = 1 << 32  # of both sequence numbers
LATE = 1000  # packets; late or duplicate up to here, a restart if further behind
_REQUEST = struct.Struct(">HHI")
_RECORD = struct.Struct(">III6i")
_MARK = 0x1234
_ERROR = 1 << 31  # summary bit of all failures
_SATURATED = 1 << 17
_LATCHED = 1 << 16  # user-defined monitor condition, not a failure
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
        number: RDT sequence number since the start of the stream.
        measurement: F/T sequence number.
        status: 32 bits; 0 = no fault.
        counts: fx fy fz tx ty tz.
    """

    number: int
    measurement: int
    status: int
    counts: tuple[int, int, int, int, int, int]


def encode_request(command: int, count: int = 0) -> bytes:
    """Return a request for `count` samples, 0 = continuous."""
    return _REQUEST.pack(_MARK, command, count)


def decode_request(data: bytes) -> tuple[int, int] | None:
    """Return command and count of a request; None if it is not one."""
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


def status_texts(status: int) -> tuple[str, ...]:
    """Return the meanings of the set status bits; by number if not documented."""
    bits = (bit for bit in range(31, -1, -1) if status >> bit & 1)
    return tuple(_WORDS.get(bit, f"failure, bit {bit}") for bit in bits)


class RdtScanner(FrameScanner[Reading]):
    """Delivers records in order of sequence number, each once.

    Reordered packets within one read are sorted. Packets that arrive after a newer one
    was delivered, and duplicates, are dropped; the former show as lost by the sequence
    numbers.

    Attributes:
        late: dropped late or duplicate records.
    """

    def __init__(self, counts: Wrench, ranges: Wrench) -> None:
        """Set counts per N and N m, and the measuring ranges [N, N m]."""
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
            saturated = ALL_AXES  # the axis is not reported
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
        ahead = [_signed_difference(reading.ticks, start) for reading in readings]
        is_restarted = min(ahead) < -LATE
        if is_restarted:  # sequence restarted: the timestamper detects the jump
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


def _signed_difference(number: int, start: int) -> int:
    """Return number - start modulo the wrap, signed."""
    half = MODULUS // 2
    return (number - start + half) % MODULUS - half
