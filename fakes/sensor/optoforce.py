"""A simulated OptoForce / OnRobot HEX sensor: its frames and commands."""

from dataclasses import dataclass

from fakes.sensor.errors import SensorErrors
from fakes.sensor.firmware import Measurement, SampleSchedule, TimedBytes, count_of
from fakes.sensor.stream import SensorStream, Source
from ft_sensor.reading import Wrench
from ft_sensor.vendors import optoforce
from ft_sensor.vendors.optoforce import OptoForceFrame

SERIAL_NUMBER = "HEX00042"
SENSITIVITY: Wrench = (18.28, 18.41, 2.12, 278.72, 259.55, 448.47)
_REPLY_NS = 1_000_000
_MAX_INPUT = 64
_SIZES = {0xAA: 9, 0xAB: 6}


@dataclass(frozen=True, slots=True)
class OptoForceOptions:
    """Identity and initial faults of the device.

    Attributes:
        serial_number: eight characters at most.
        sensitivity: counts per N and per N m.
        is_running: it streams at 1000 Hz already; otherwise at 100 Hz, as shipped.
        baudrate: speed of its line [bit/s].
        clock_error_ppm: rate error of its clock, positive = fast [parts per million].
        counter_start: first value of its counter.
        refusal: error code of its answer to every configuration; 0 = it accepts.
        is_deaf: it ignores commands.
    """

    serial_number: str = SERIAL_NUMBER
    sensitivity: Wrench = SENSITIVITY
    is_running: bool = False
    baudrate: int = 1_000_000
    clock_error_ppm: float = 0.0
    counter_start: int = 0
    refusal: int = 0
    is_deaf: bool = False


_NORMAL = OptoForceOptions()


def optoforce_stream(
    source: Source,
    errors: SensorErrors | None = None,
    options: OptoForceOptions = _NORMAL,
    start_ns: int = 0,
) -> SensorStream:
    """Return an OptoForce sensor with the load `source`."""
    return SensorStream(OptoForceFirmware(options, start_ns), source, errors, start_ns)


class OptoForceFirmware:
    """Implements `fakes.sensor.stream.Firmware`; streams from power-on."""

    frame_size = optoforce.FRAME_SIZE
    drops_damaged_frames = False

    def __init__(self, options: OptoForceOptions, start_ns: int) -> None:
        self.baudrate = options.baudrate
        self.clock_rate = 1 + options.clock_error_ppm * 1e-6
        self.schedule: SampleSchedule | None = None
        self.on_since_ns = start_ns
        self._options = options
        self._input = b""
        self._start_stream(start_ns, 1 if options.is_running else 10)

    def power_up(self, t_ns: int) -> list[TimedBytes]:
        """Restart with a stream of 100 Hz."""
        self._input = b""
        self.on_since_ns = t_ns
        self._start_stream(t_ns, 10)
        return []

    def receive(self, t_ns: int, data: bytes) -> list[TimedBytes]:
        """Carry out the commands in `data`; return the answers."""
        if self._options.is_deaf:
            return []
        outputs: list[TimedBytes] = []
        self._input = (self._input + data)[-_MAX_INPUT:]
        while self._input:
            size = _SIZES.get(self._input[0], 1)
            if len(self._input) < size:
                break
            answer = self._answer(t_ns, self._input[:size])
            self._input = self._input[size if answer else 1 :]
            outputs += [(t_ns + _REPLY_NS, answer)] if answer else []
        return outputs

    def frame(self, measurement: Measurement, status: int) -> bytes:
        """Return the 22 bytes of a sample."""
        pairs = zip(measurement.wrench, self._options.sensitivity, strict=True)
        counts = [count_of(value * gain) for value, gain in pairs]
        overload = measurement.saturated
        for axis, count in enumerate(counts):
            if abs(count) >= optoforce.FULL_COUNTS:
                overload |= 1 << axis
        for axis in range(6):
            status |= (overload >> axis & 1) << (9 - axis)
        fx, fy, fz, tx, ty, tz = counts
        counter = self._options.counter_start + measurement.number
        return optoforce.encode_frame(
            OptoForceFrame(
                counter % optoforce.COUNTER_MODULUS, status, (fx, fy, fz, tx, ty, tz)
            )
        )

    def _start_stream(self, t_ns: int, period_ms: int) -> None:
        self.schedule = SampleSchedule(t_ns, period_ms * 1e6 / self.clock_rate)

    def _answer(self, t_ns: int, data: bytes) -> bytes | None:
        if data == optoforce.ASK_SERIAL:
            return optoforce.encode_serial_number(self._options.serial_number)
        configuration = optoforce.decode_configuration(data)
        if configuration is None:
            return None
        if self._options.refusal:
            return optoforce.encode_configuration_answer(self._options.refusal)
        period_ms = configuration[0]
        if period_ms == optoforce.STOPPED:
            self.schedule = None
        elif period_ms in optoforce.SPEED_CODES.values():
            self._start_stream(t_ns + 2 * _REPLY_NS, period_ms)
        else:
            return optoforce.encode_configuration_answer(1)
        return optoforce.encode_configuration_answer(0)
