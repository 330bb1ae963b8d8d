"""A simulated Robotous RFT sensor: its frames and commands."""

from dataclasses import dataclass

from fakes.sensor.errors import SensorErrors
from fakes.sensor.firmware import Measurement, SampleSchedule, TimedBytes, count_of
from fakes.sensor.stream import SensorStream, Source
from ft_sensor.reading import Wrench
from ft_sensor.vendors import robotous
from ft_sensor.vendors.robotous import MODELS, RobotousFrame

_REPLY_NS = 1_000_000
_OVERLOAD = 1.2  # times rated load
_RATES = {code: rate for rate, code in robotous.RATE_CODES.items()}
_TEXTS = {robotous.SERIAL: "RF60-0042", robotous.FIRMWARE: "V1.0.0"}


@dataclass(frozen=True, slots=True)
class RobotousOptions:
    """Identity and initial faults of the device.

    Attributes:
        model: its reported model.
        is_running: it streams from the start.
        baudrate: speed of its line [bit/s].
        clock_error_ppm: rate error of its clock, positive = fast [parts per million].
        refused: commands it answers with error 2.
        is_deaf: it ignores commands.
        forgets: it acknowledges new rates and filters without applying them.
    """

    model: str = "RFT60-HA01"
    is_running: bool = False
    baudrate: int = 921600
    clock_error_ppm: float = 0.0
    refused: tuple[int, ...] = ()
    is_deaf: bool = False
    forgets: bool = False


_NORMAL = RobotousOptions()


def robotous_stream(
    source: Source,
    errors: SensorErrors | None = None,
    options: RobotousOptions = _NORMAL,
    start_ns: int = 0,
) -> SensorStream:
    """Return a Robotous sensor with the load `source`."""
    return SensorStream(RobotousFirmware(options, start_ns), source, errors, start_ns)


class RobotousFirmware:
    """Implements `fakes.sensor.stream.Firmware`.

    Powers up idle; filter, rate and line speed are non-volatile.
    """

    frame_size = robotous.FRAME_SIZE
    drops_damaged_frames = False

    def __init__(self, options: RobotousOptions, start_ns: int) -> None:
        self.baudrate = options.baudrate
        self.clock_rate = 1 + options.clock_error_ppm * 1e-6
        self.schedule: SampleSchedule | None = None
        self.on_since_ns = start_ns
        self._options = options
        model = MODELS.get(options.model)
        self._ranges: Wrench = (model or MODELS["RFT60-HA01"]).ranges
        self._torque_counts = (model or MODELS["RFT60-HA01"]).torque_counts
        self._rate_code = robotous.RATE_CODES[200]
        self._filter = (0, 0)
        self._overloads = [0] * 6
        self._input = b""
        if options.is_running:
            self._rate_code = robotous.RATE_CODES[1000]
            self._start_stream(start_ns)

    def power_up(self, t_ns: int) -> list[TimedBytes]:
        """Restart idle, without a stream."""
        self.on_since_ns = t_ns
        self._input = b""
        self.schedule = None
        return []

    def receive(self, t_ns: int, data: bytes) -> list[TimedBytes]:
        """Carry out the commands in `data`; return the answers."""
        if self._options.is_deaf:
            return []
        outputs: list[TimedBytes] = []
        self._input = (self._input + data)[-8 * robotous.COMMAND_SIZE :]
        while len(self._input) >= robotous.COMMAND_SIZE:
            command = robotous.decode_command(self._input[: robotous.COMMAND_SIZE])
            if command is None:
                self._input = self._input[1:]
                continue
            self._input = self._input[robotous.COMMAND_SIZE :]
            answer = self._handle(t_ns, *command)
            outputs += [(t_ns + _REPLY_NS, answer)] if answer else []
        return outputs

    def frame(self, measurement: Measurement, status: int) -> bytes:
        """Return the 19 bytes of a sample."""
        fx, fy, fz, tx, ty, tz = (
            count_of(value * gain)
            for value, gain in zip(measurement.wrench, self._gains(), strict=True)
        )
        overload = status
        for axis, (value, rated) in enumerate(
            zip(measurement.wrench, self._ranges, strict=True)
        ):
            if abs(value) > _OVERLOAD * rated or measurement.saturated >> axis & 1:
                overload |= 1 << (5 - axis)
                self._overloads[axis] = min(self._overloads[axis] + 1, 255)
        return robotous.encode_frame(
            RobotousFrame((fx, fy, fz, tx, ty, tz), overload & 0x3F)
        )

    def _gains(self) -> tuple[float, ...]:
        return (robotous.FORCE_COUNTS,) * 3 + (self._torque_counts,) * 3

    def _start_stream(self, t_ns: int) -> None:
        period_ns = 1e9 / _RATES[self._rate_code] / self.clock_rate
        self.schedule = SampleSchedule(t_ns, period_ns)

    def _handle(self, t_ns: int, command: int, parameters: bytes) -> bytes | None:
        if command == robotous.STOP:
            self.schedule = None
            return None
        if self.schedule is not None or command == robotous.BIAS:
            return None  # while streaming, it accepts stop and bias only
        if command in self._options.refused:
            return robotous.encode_answer(command, 0, 2)
        if command == robotous.STREAM:
            self._start_stream(t_ns + 2 * _REPLY_NS)
            return None
        return self._answer(command, parameters)

    def _answer(self, command: int, parameters: bytes) -> bytes | None:
        texts = {robotous.MODEL: self._options.model, **_TEXTS}
        if command in texts:
            return robotous.encode_answer(command, *texts[command].encode("ascii"))
        if command in (robotous.SET_BAUDRATE, robotous.SET_FILTER, robotous.SET_RATE):
            if not self._options.forgets:
                self._apply_setting(command, parameters)
            return robotous.encode_answer(command, 1, 0)
        values = {
            robotous.GET_FILTER: self._filter,
            robotous.GET_RATE: (self._rate_code,),
            robotous.OVERLOADS: tuple(self._overloads),
        }
        return (
            robotous.encode_answer(command, *values[command])
            if command in values
            else None
        )

    def _apply_setting(self, command: int, parameters: bytes) -> None:
        if command == robotous.SET_RATE and parameters[0] in _RATES:
            self._rate_code = parameters[0]
        elif command == robotous.SET_FILTER:
            self._filter = (parameters[0], parameters[1])
