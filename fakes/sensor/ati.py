"""A simulated ATI sensor on the network: its records and requests."""

from dataclasses import dataclass

from fakes.sensor.errors import SensorErrors
from fakes.sensor.firmware import Measurement, SampleSchedule, TimedBytes
from fakes.sensor.stream import SensorStream, Source
from ft_sensor.reading import Wrench
from ft_sensor.vendors import ati
from ft_sensor.vendors.ati import RdtRecord

COUNTS = (1_000_000.0, 1_000_000.0)  # per N, per N m
RANGES: Wrench = (130.0, 130.0, 400.0, 10.0, 10.0, 10.0)
_FULL = 2**31 - 1
_DELAY_NS = 200_000  # from a request to the first record
_ERROR, _SATURATED = 1 << 31, 1 << 17


@dataclass(frozen=True, slots=True)
class AtiOptions:
    """Identity and initial faults of the device.

    Attributes:
        counts: per N and per N m.
        rate: records per second [Hz].
        is_running: it streams already, to the host that asked before.
        baudrate: of the network [bit/s].
        clock_error_ppm: rate error of its clock, positive = fast [parts per million].
        counter_start: measurements since power-on.
        is_deaf: it ignores requests.
    """

    counts: tuple[float, float] = COUNTS
    rate: int = 1000
    is_running: bool = False
    baudrate: int = 100_000_000
    clock_error_ppm: float = 0.0
    counter_start: int = 0
    is_deaf: bool = False


_NORMAL = AtiOptions()


def ati_stream(
    source: Source,
    errors: SensorErrors | None = None,
    options: AtiOptions = _NORMAL,
    start_ns: int = 0,
) -> SensorStream:
    """Return an ATI sensor with the load `source`."""
    return SensorStream(AtiFirmware(options, start_ns), source, errors, start_ns)


class AtiFirmware:
    """Implements `fakes.sensor.stream.Firmware`; silent until a request."""

    frame_size = ati.FRAME_SIZE
    drops_damaged_frames = True  # a damaged datagram does not arrive

    def __init__(self, options: AtiOptions, start_ns: int) -> None:
        self.baudrate = options.baudrate
        self.clock_rate = 1 + options.clock_error_ppm * 1e-6
        self.schedule: SampleSchedule | None = None
        self.on_since_ns = start_ns
        self._options = options
        self._first: int | None = None
        if options.is_running:
            self._start_stream(start_ns)

    def power_up(self, t_ns: int) -> list[TimedBytes]:
        """Restart; the device sends nothing until a request."""
        self.on_since_ns = t_ns
        self.schedule = None
        self._first = None
        return []

    def receive(self, t_ns: int, data: bytes) -> list[TimedBytes]:
        """Carry out a request; there is no answer except the stream."""
        request = None if self._options.is_deaf else ati.decode_request(data)
        if request is not None and request[0] == ati.STOP:
            self.schedule = None
        elif request is not None and request[0] == ati.STREAM:
            self._start_stream(t_ns + _DELAY_NS)
        return []

    def frame(self, measurement: Measurement, status: int) -> bytes:
        """Return the 36 bytes of a record."""
        if self._first is None:
            self._first = measurement.number - 1  # numbers start at 1 with every stream
        force, torque = self._options.counts
        counts = [
            _count(value * scale)
            for value, scale in zip(
                measurement.wrench, (force,) * 3 + (torque,) * 3, strict=True
            )
        ]
        if measurement.saturated:
            status |= _ERROR | _SATURATED
        fx, fy, fz, tx, ty, tz = counts
        counter = self._options.counter_start + measurement.number
        return ati.encode_record(
            RdtRecord(
                (measurement.number - self._first) % ati.MODULUS,
                counter % ati.MODULUS,
                status,
                (fx, fy, fz, tx, ty, tz),
            )
        )

    def _start_stream(self, t_ns: int) -> None:
        self._first = None
        period_ns = 1e9 / self._options.rate / self.clock_rate
        self.schedule = SampleSchedule(t_ns, period_ns)


def _count(value: float) -> int:
    """Return a 32-bit count; NaN reads full scale."""
    if not abs(value) < _FULL:
        return _FULL if not value < 0 else -_FULL
    return round(value)
