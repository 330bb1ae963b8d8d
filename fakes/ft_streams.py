"""The bytes a wrist sensor sends, as a function of simulated time and of nothing else.

`BotaStream` is the device behind the wire. It is told the time and never waits.
"""

import re
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from fakes.sensor_errors import SensorErrors
from ft_sensor import bota
from ft_sensor.bota import Acknowledgement, BootText, BotaFrame

Source = Callable[[int], Sequence[float]]

_BOOT_NS = 400_000_000  # nothing is said before the port's opening has settled
_LINE_PAUSE_NS = 100_000_000
_SETTLE_NS = 200_000_000  # from the boot text to the first sample
_REPLY_NS = 2_000_000
_SHIPPED_SINC = 512  # 100 Hz: what the device does until it is told otherwise
_TEMPERATURE = 25.0  # [degrees Celsius]
_BOOT_TEXT = BootText(True, "Fake F/T sensor", "20001", "fake 1.0")
_COMMAND = re.compile(rb"[CRI#]|c,\d,\d,\d,\d|f,(\d{1,4}),\d,\d,\d")
_COMMAND_BEGIN = re.compile(rb"c(,(\d(,(\d(,(\d(,)?)?)?)?)?)?)?|f(,[\d,]{0,10})?")


class Mode(Enum):
    """What the device is doing."""

    RUN = auto()
    CONFIGURATION = auto()


class ByteFault(Enum):
    """What may happen to one byte on the wire."""

    FLIP = auto()
    DROP = auto()
    DOUBLE = auto()


def damage(data: bytes, fault: ByteFault, index: int, bit: int = 0) -> bytes:
    """Return `data` with one byte, at `index`, flipped in `bit`, dropped or doubled."""
    byte = data[index : index + 1]
    middle = {
        ByteFault.FLIP: bytes((byte[0] ^ 1 << bit,)),
        ByteFault.DROP: b"",
        ByteFault.DOUBLE: byte * 2,
    }[fault]
    return data[:index] + middle + data[index + 1 :]


@dataclass(frozen=True, slots=True)
class BotaOptions:
    """Which device it is and what is wrong with it from the start.

    Attributes:
        boot_text: what it says after power-on; the fake's own words.
        is_running: it has been streaming since before the beginning; otherwise it is
            switched on at the beginning and boots.
        resets_on_open: opening the port boots it.
        baudrate: speed of its line [bit/s].
        clock_error_ppm: how much its clock runs fast [parts per million].
        clock_start_us: what its clock shows at power-on [us].
        sinc: fixed sinc length; 0 = 512 until commanded.
        refused: letters of the commands it answers with code 1.
        is_deaf: it takes no commands.
        raw_starts: so many starts leave the calibration matrix inactive.
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


class BotaStream:
    """A Bota sensor of generation 1 seen from its end of the wire.

    `source(t_ns)` is the true load at an instant: fx fy fz tx ty tz in the sensor frame
    [N, N m]. It is called once per sample, in order of time, when `due` reaches the
    instant of the sample.

    Attributes:
        errors: added to the load; None = shown as it is. A constant load without
            errors repeats bit for bit, which drivers rightly take for a frozen sensor.
        status: status bits set in every frame, beside those the device sets itself.
        is_clock_frozen: the device's clock stands still.
    """

    def __init__(
        self,
        source: Source,
        errors: SensorErrors | None = None,
        options: BotaOptions = _NORMAL,
        start_ns: int = 0,
    ) -> None:
        self.errors = errors
        self.options = options
        self.status = 0
        self.is_clock_frozen = False
        self._source = source
        self._pending: deque[tuple[int, bytes]] = deque()
        self._wire_free_ns = start_ns
        self._raw_starts = options.raw_starts
        self._is_silent = False
        self._paused_until_ns = start_ns
        self._fault: tuple[ByteFault, int] | None = None
        self._clock_zero_ns = start_ns
        self._device_us = options.clock_start_us
        if options.is_running:
            self._power_up()
            self._ready_ns = start_ns
            self._run_from(start_ns)
        else:
            self.reset(start_ns)

    def reset(self, t_ns: int) -> None:
        """Switch the power off and on at `t_ns`; settings are lost."""
        self._power_up()
        self._clock_zero_ns = t_ns
        self._pending.clear()
        self._wire_free_ns = t_ns
        speak_ns = t_ns + _BOOT_NS
        for line in bota.encode_boot_text(self.options.boot_text).splitlines(True):
            self._send(speak_ns, line)
            speak_ns += _LINE_PAUSE_NS
        self._ready_ns = speak_ns + _SETTLE_NS
        self._run_from(self._ready_ns)

    def port_opened(self, t_ns: int) -> None:
        """Tell the device that somebody opened its port."""
        if self.options.resets_on_open:
            self.reset(t_ns)

    def receive(self, t_ns: int, data: bytes) -> None:
        """Take bytes written by the client at `t_ns`."""
        self._sample_until(t_ns)
        if self.options.is_deaf or t_ns < self._ready_ns:
            return
        self._input = (self._input + data)[-bota.MAX_COMMAND_SIZE :]
        while self._input:
            command = _COMMAND.match(self._input)
            if command is not None:
                self._input = self._input[command.end() :]
                self._obey(t_ns, command)
            elif _COMMAND_BEGIN.fullmatch(self._input):
                return
            else:
                self._input = self._input[1:]

    def due(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Return (time, bytes) of all that has left the wire by `t_ns`, in order."""
        self._sample_until(t_ns)
        pending = self._pending
        gone: list[tuple[int, bytes]] = []
        while pending and pending[0][0] <= t_ns:
            gone.append(pending.popleft())
        return gone

    def next_event_ns(self) -> int | None:
        """Return when the next bytes will have left the wire; None = never."""
        if self._pending:
            return self._pending[0][0]
        if self._mode is not Mode.RUN or self._is_silent:
            return None
        return self._sample_ns + self._frame_wire_ns

    def go_silent(self) -> None:
        """Say nothing from now on, until `speak`: a cut cable."""
        self._is_silent = True
        self._pending.clear()

    def speak(self) -> None:
        """End the silence."""
        self._is_silent = False

    def pause(self, until_ns: int) -> None:
        """Lose the samples before `until_ns`; the device's clock goes on."""
        self._paused_until_ns = until_ns

    def damage_next(self, fault: ByteFault, index: int) -> None:
        """Damage byte `index` of the next frame on the wire."""
        self._fault = (fault, index)

    def _power_up(self) -> None:
        self._input = b""
        self._sinc = self.options.sinc or _SHIPPED_SINC
        self._frame_wire_ns = bota.wire_time_ns(bota.FRAME_SIZE, self.options.baudrate)
        self._is_skipping = False
        self._start_measuring()

    def _start_measuring(self) -> None:
        self._is_raw = self._raw_starts > 0
        self._raw_starts -= self._is_raw

    def _run_from(self, t_ns: int) -> None:
        self._mode = Mode.RUN
        self._first_ns = t_ns
        self._count = 0
        # The device counts its own time, so a fast clock samples early.
        rate = 1 + self.options.clock_error_ppm * 1e-6
        self._period_ns = bota.frame_period_ns(self._sinc) / rate
        self._clock_rate = rate
        self._sample_ns = t_ns

    def _sample_until(self, t_ns: int) -> None:
        while self._mode is Mode.RUN and self._sample_ns <= t_ns:
            self._take_sample(self._sample_ns)
            self._count += 1
            self._sample_ns = self._first_ns + round(self._count * self._period_ns)

    def _take_sample(self, t_ns: int) -> None:
        wrench = self._source(t_ns)
        if self.errors is not None:
            wrench = self.errors.apply(t_ns, wrench)
        if self._is_silent or t_ns < self._paused_until_ns:
            return
        if self._wire_free_ns > t_ns + self._period_ns:
            self._is_skipping = True  # the line is too slow for the rate
            return
        fx, fy, fz, tx, ty, tz = wrench
        frame = BotaFrame(
            self.status | self._is_skipping | self._is_raw << 3,
            (fx, fy, fz, tx, ty, tz),
            self._clock_us(t_ns),
            _TEMPERATURE,
        )
        self._is_skipping = False
        data = bota.encode_frame(frame)
        if self._fault is not None:
            data = damage(data, *self._fault)
            self._fault = None
        self._send(t_ns, data)

    def _clock_us(self, t_ns: int) -> int:
        if not self.is_clock_frozen:
            passed_ns = round((t_ns - self._clock_zero_ns) * self._clock_rate)
            self._device_us = self.options.clock_start_us + passed_ns // 1000
        return self._device_us % (1 << 32)

    def _send(self, t_ns: int, data: bytes) -> None:
        """Put `data` on the wire as soon as it is free, not before `t_ns`."""
        if self._is_silent:
            return
        wire_ns = bota.wire_time_ns(len(data), self.options.baudrate)
        self._wire_free_ns = max(self._wire_free_ns, t_ns) + wire_ns
        self._pending.append((self._wire_free_ns, data))

    def _obey(self, t_ns: int, command: re.Match[bytes]) -> None:
        letter = chr(command[0][0])
        if letter == "#":
            self.reset(t_ns)
            return
        is_running = self._mode is Mode.RUN
        is_allowed = letter == "I" or is_running == (letter == "C")
        is_refused = not is_allowed or letter in self.options.refused
        if letter == "f" and not 1 <= int(command[1]) <= _SHIPPED_SINC:
            is_refused = True
        answer = Acknowledgement(letter, int(is_refused))
        self._send(t_ns + _REPLY_NS, bota.encode_acknowledgement(answer))
        if not is_refused:
            self._carry_out(t_ns, letter, command)

    def _carry_out(self, t_ns: int, letter: str, command: re.Match[bytes]) -> None:
        if letter == "C":
            self._mode = Mode.CONFIGURATION
        elif letter == "I":
            self._mode = Mode.CONFIGURATION
            self._sinc = self.options.sinc or _SHIPPED_SINC
            self._start_measuring()
        elif letter == "f" and not self.options.sinc:
            self._sinc = int(command[1])
        elif letter == "R":
            self._run_from(t_ns + 2 * _REPLY_NS)
