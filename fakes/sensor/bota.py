"""A simulated Bota sensor of generation 1: its frames, texts and commands."""

import re
from dataclasses import dataclass
from enum import Enum, auto

from fakes.sensor.errors import SensorErrors
from fakes.sensor.firmware import Measurement, SampleSchedule, TimedBytes
from fakes.sensor.stream import SensorStream, Source
from ft_sensor.vendors import bota
from ft_sensor.vendors.bota import Acknowledgement, BootText, BotaFrame

_BOOT_NS = 400_000_000  # silence after power-on or the opening of the port
_LINE_PAUSE_NS = 100_000_000
_SETTLE_NS = 200_000_000  # from the boot text to the first sample
_REPLY_NS = 2_000_000
_SHIPPED_SINC = 512  # 100 Hz: the device's default
_BOOT_TEXT = BootText(True, "Fake F/T sensor", "20001", "fake 1.0")
_COMMAND = re.compile(rb"[CRI#]|c,\d,\d,\d,\d|f,(\d{1,4}),\d,\d,\d")
_COMMAND_BEGIN = re.compile(rb"c(,(\d(,(\d(,(\d(,)?)?)?)?)?)?)?|f(,[\d,]{0,10})?")


class BotaMode(Enum):
    """Operating mode of the device."""

    RUN = auto()
    CONFIGURATION = auto()


@dataclass(frozen=True, slots=True)
class BotaOptions:
    """Identity and initial faults of the device.

    Attributes:
        boot_text: its text after power-on; not a real device's.
        is_running: it streams from the start; otherwise it is switched on then and
            boots.
        resets_on_open: opening the port reboots it.
        baudrate: speed of its line [bit/s].
        clock_error_ppm: rate error of its clock, positive = fast [parts per million].
        clock_start_us: its clock at power-on [us].
        sinc: fixed sinc length; 0 = 512 until commanded.
        refused: letters of the commands it answers with code 1.
        is_deaf: it ignores commands.
        raw_starts: number of starts that leave the calibration matrix inactive.
    """

    boot_text: BootText = _BOOT_TEXT
    is_running: bool = False
    resets_on_open: bool = False
    baudrate: int = 460800
    clock_error_ppm: float = 0.0
    clock_start_us: int = 0
    sinc: int = 0
    refused: str = ""
    is_deaf: bool = False
    raw_starts: int = 0


_NORMAL = BotaOptions()


def bota_stream(
    source: Source,
    errors: SensorErrors | None = None,
    options: BotaOptions = _NORMAL,
    start_ns: int = 0,
) -> SensorStream:
    """Return a Bota sensor with the load `source`."""
    firmware = BotaFirmware(options, start_ns)
    stream = SensorStream(firmware, source, errors, start_ns, options.clock_start_us)
    stream.resets_on_open = options.resets_on_open
    return stream


class BotaFirmware:
    """Implements `fakes.sensor.stream.Firmware`.

    Attributes:
        is_raw: its calibration matrix is inactive, as its frames report.
    """

    frame_size = bota.FRAME_SIZE
    drops_damaged_frames = False

    def __init__(self, options: BotaOptions, start_ns: int) -> None:
        self.baudrate = options.baudrate
        # The device counts its own time, so a fast clock samples early.
        self.clock_rate = 1 + options.clock_error_ppm * 1e-6
        self.schedule: SampleSchedule | None = None
        self.on_since_ns = start_ns
        self._options = options
        self._raw_starts = options.raw_starts
        self._reset_state()
        self._ready_ns = start_ns
        if options.is_running:
            self._start_stream(start_ns)

    def power_up(self, t_ns: int) -> list[TimedBytes]:
        """Boot; return the lines of the boot text with their times."""
        self._reset_state()
        self.on_since_ns = t_ns
        outputs: list[TimedBytes] = []
        line_ns = t_ns + _BOOT_NS
        for line in bota.encode_boot_text(self._options.boot_text).splitlines(True):
            outputs.append((line_ns, line))
            line_ns += _LINE_PAUSE_NS
        self._ready_ns = line_ns + _SETTLE_NS
        self._start_stream(self._ready_ns)
        return outputs

    def receive(self, t_ns: int, data: bytes) -> list[TimedBytes]:
        """Carry out the commands in `data`; return the acknowledgements."""
        if self._options.is_deaf or t_ns < self._ready_ns:
            return []
        outputs: list[TimedBytes] = []
        self._input = (self._input + data)[-bota.MAX_COMMAND_SIZE :]
        while self._input:
            command = _COMMAND.match(self._input)
            if command is not None:
                self._input = self._input[command.end() :]
                outputs += self._handle(t_ns, command)
            elif _COMMAND_BEGIN.fullmatch(self._input):
                break
            else:
                self._input = self._input[1:]
        return outputs

    def frame(self, measurement: Measurement, status: int) -> bytes:
        """Return the 37 bytes of a sample."""
        status |= (
            measurement.has_skipped
            | self.is_raw << 3
            | (measurement.saturated > 0) << 1
        )
        return bota.encode_frame(
            BotaFrame(
                status,
                measurement.wrench,
                measurement.device_us % bota.CLOCK_MODULUS,
                measurement.temperature,
            )
        )

    def _reset_state(self) -> None:
        self._input = b""
        self._sinc = self._options.sinc or _SHIPPED_SINC
        self._start_measuring()

    def _start_measuring(self) -> None:
        self.is_raw = self._raw_starts > 0
        self._raw_starts -= self.is_raw

    def _start_stream(self, t_ns: int) -> None:
        self._mode = BotaMode.RUN
        period_ns = bota.frame_period_ns(self._sinc) / self.clock_rate
        self.schedule = SampleSchedule(t_ns, period_ns)

    def _stop(self) -> None:
        self._mode = BotaMode.CONFIGURATION
        self.schedule = None

    def _handle(self, t_ns: int, command: re.Match[bytes]) -> list[TimedBytes]:
        letter = chr(command[0][0])
        if letter == "#":
            return self.power_up(t_ns)
        is_running = self._mode is BotaMode.RUN
        is_allowed = letter == "I" or is_running == (letter == "C")
        is_refused = not is_allowed or letter in self._options.refused
        if letter == "f" and not 1 <= int(command[1]) <= _SHIPPED_SINC:
            is_refused = True
        answer = bota.encode_acknowledgement(Acknowledgement(letter, int(is_refused)))
        if not is_refused:
            self._execute(t_ns, letter, command)
        return [(t_ns + _REPLY_NS, answer)]

    def _execute(self, t_ns: int, letter: str, command: re.Match[bytes]) -> None:
        if letter == "C":
            self._stop()
        elif letter == "I":
            self._stop()
            self._sinc = self._options.sinc or _SHIPPED_SINC
            self._start_measuring()
        elif letter == "f" and not self._options.sinc:
            self._sinc = int(command[1])
        elif letter == "R":
            self._start_stream(t_ns + 2 * _REPLY_NS)
