"""Driver part of Bota sensors of generation 1: start-up from any mode, settings."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from acquisition.clock import NS_PER_S
from acquisition.errors import DeviceFaultError, LinkTimeoutError, SettingsError
from acquisition.settings import Number, UsualRange, Whole
from ft_sensor.reading import Reading, StreamTiming, Wrench
from ft_sensor.section import SensorSection
from ft_sensor.serial_line.framing import FrameScanner, wire_time_ns
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.startup import FIRST_READINGS, SerialDialog
from ft_sensor.vendors import bota
from ft_sensor.vendors.bota import BootText, BotaStatus

BAUDRATE = 460800
# Commonly quoted for the SensONE, not verified; rig.toml can override them.
RANGES: Wrench = (500.0, 500.0, 1200.0, 15.0, 15.0, 12.0)
_FROZEN_NS = 50_000_000  # noise never repeats six floats for that long
_STUCK_NS = 250_000_000  # one float repeated for 160 ms in a recording at 100 Hz
_LISTEN_NS = 3 * NS_PER_S  # boot time of a sensor that was reset by opening the port
_SETTLE_NS = NS_PER_S // 2
_ANSWER_NS = 2 * NS_PER_S
_KEYSTROKE_NS = 5_000_000  # least time between two command bytes
_RESET_NS = 1_500_000_000
_TRIES = 3
_RESETS = 5  # the calibration matrix may take several starts to become active
_PLAUSIBLE_OF_TEN = 8
_MAX_FORCE = 500.0  # [N]; larger values at rest are raw gauge data
_MAX_TORQUE = 50.0  # [N m]


@dataclass(frozen=True, slots=True)
class BotaSettings:
    """Settings of a Bota sensor.

    Attributes:
        sinc: sinc filter length; the rate is 51200 / sinc [Hz].
        is_fir_on: FIR filter on: cut-off 189 Hz at sinc 64, without it 1255 Hz.
        ranges: measuring ranges fx fy fz tx ty tz [N, N m].
    """

    sinc: int = 64
    is_fir_on: bool = True
    ranges: Wrench = RANGES

    def __post_init__(self) -> None:
        """Validate the settings.

        Raises:
            SettingsError: the sinc length is out of range.
        """
        if not 1 <= self.sinc <= 512:
            raise SettingsError(
                f"F/T sensor sinc length {self.sinc} is out of range (1 to 512).",
                hint="Sinc 64 gives 800 Hz.",
            )


class BotaDevice:
    """Implements `ft_sensor.serial_line.sensor.SerialDevice` for a Bota sensor."""

    stop = bota.CONFIGURE

    def __init__(self, line: PortSettings, settings: BotaSettings) -> None:
        """Set up line and timing; no I/O.

        Raises:
            SettingsError: the line cannot carry the stream.
        """
        period_ns = bota.frame_period_ns(settings.sinc)
        line.require(tuple(bota.BAUD_CODES), bota.FRAME_SIZE, period_ns)
        self.line = line
        self.ranges = settings.ranges
        self.timing = StreamTiming(
            period_ns=period_ns,
            wire_ns=wire_time_ns(bota.FRAME_SIZE, line.baudrate),
            modulus=bota.CLOCK_MODULUS,
            tick_ns=1000.0,
            frozen_ns=_FROZEN_NS,
            stuck_ns=_STUCK_NS,
            frame_size=bota.FRAME_SIZE,
        )
        self._settings = settings
        self._boot = BootText()
        self._answers = 0

    def scanner(self) -> FrameScanner[Reading]:
        """Return a scanner for the frames of the stream."""
        return bota.scanner(self.ranges)

    def status_texts(self, status: int) -> tuple[str, ...]:
        """Return the meanings of the set bits of `status`."""
        return bota.status_texts(status)

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Configure the sensor, start its stream, and return its description.

        Waits up to three seconds for a boot message or a running stream; a sensor in
        configuration mode sends neither and is configured without.

        Raises:
            LinkError: the port failed, or the data are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: it refused a command, or its calibration matrix stays
                inactive.
        """
        self._boot, self._answers = BootText(), 0
        dialog.wait_for(lambda: self._first_sign(dialog), _LISTEN_NS)
        if self._boot.is_complete:
            # Commands are ignored until the stream runs.
            dialog.wait_for(lambda: dialog.frames > 0 or None, _SETTLE_NS)
        self._start_until_plausible(dialog)
        fir = "on" if self._settings.is_fir_on else "off"
        unknown = "unknown (no boot text seen)"
        return {
            "model": "Bota serial, generation 1",
            "name": self._boot.name or unknown,
            "serial_number": self._boot.serial_number or unknown,
            "firmware": self._boot.firmware or unknown,
            "filter": f"sinc {self._settings.sinc}, FIR {fir}",
            "time": "device clock, fitted to arrival less wire time; filter unknown",
        }

    def _first_sign(self, dialog: SerialDialog) -> bool | None:
        self._boot = bota.find_boot_text(dialog.buffer)
        return self._boot.is_complete or dialog.frames > 0 or None

    def _start_until_plausible(self, dialog: SerialDialog) -> None:
        for _ in range(_RESETS):
            self._set_up(dialog)
            if _is_plausible(dialog.first_readings()):
                return
            dialog.write(bota.SOFT_RESET)
            dialog.pause(_RESET_NS)
            dialog.discard()
        raise DeviceFaultError(
            f"The F/T sensor sends raw gauge data or absurd forces after "
            f"{_RESETS} starts (limits {_MAX_FORCE:g} N, {_MAX_TORQUE:g} N m).",
            hint="Switch its power off for ten seconds, then open it again.",
        )

    def _set_up(self, dialog: SerialDialog) -> None:
        """Bring the sensor from any mode to a running stream, with retries."""
        for tries_left in reversed(range(_TRIES)):
            try:
                self._configure_and_run(dialog)
            except (DeviceFaultError, LinkTimeoutError):
                has_signs = self._answers or dialog.frames or self._boot.is_started
                if not has_signs:
                    dialog.raise_no_reply(self.line.baudrate)
                if not tries_left:
                    raise
            else:
                return

    def _configure_and_run(self, dialog: SerialDialog) -> None:
        # A sensor already in configuration mode may not acknowledge this one.
        self._ask(dialog, bota.CONFIGURE)
        for command in (
            bota.communication_command(self.line.baudrate),
            bota.filter_command(self._settings.sinc, self._settings.is_fir_on),
            bota.RUN,
        ):
            code = self._ask(dialog, command)
            text = command.decode("ascii")
            if code is None:
                raise LinkTimeoutError(
                    f"The F/T sensor did not answer '{text}' within "
                    f"{_ANSWER_NS / NS_PER_S:g} s.",
                    hint="Check the cable in both directions; cycle its power.",
                )
            if code != 0:
                raise DeviceFaultError(
                    f"The F/T sensor refused '{text}' with code {code}.",
                    hint="Check sinc length and speed against its manual.",
                )

    def _ask(self, dialog: SerialDialog, command: bytes) -> int | None:
        """Send `command`; return the code of its reply, None without a reply."""
        for key in command:
            dialog.write(bytes((key,)))
            dialog.pause(_KEYSTROKE_NS)
        letter = chr(command[0])

        def answer() -> int | None:
            for acknowledgement in bota.find_acknowledgements(dialog.buffer):
                if acknowledgement.letter == letter:
                    self._answers += 1
                    return acknowledgement.code
            return None

        return dialog.wait_for(answer, _ANSWER_NS)


def _is_plausible(readings: list[Reading]) -> bool:
    """Return whether most of the first ten readings are plausible."""
    good = [
        not reading.status & BotaStatus.RAW_GAUGE
        and all(abs(force) < _MAX_FORCE for force in reading.wrench[:3])
        and all(abs(torque) < _MAX_TORQUE for torque in reading.wrench[3:])
        for reading in readings[:FIRST_READINGS]
    ]
    return sum(good) >= _PLAUSIBLE_OF_TEN


_Force = Annotated[Number, Field(ge=10, le=5000), UsualRange(50.0, 2500.0, "N")]
_Moment = Annotated[Number, Field(ge=0.5, le=200), UsualRange(1.0, 50.0, "N m")]
_Ranges = tuple[_Force, _Force, _Force, _Moment, _Moment, _Moment]


class BotaSection(SensorSection):
    """[ft_sensor] of a Bota sensor.

    Attributes:
        sinc: filter length, see `BotaSettings`.
        ranges: measuring ranges of this unit [N, N m]; default: commonly quoted ones.
    """

    kind: Literal["bota"] = Field(examples=["bota"])
    baudrate: Whole = Field(default=BAUDRATE, gt=0, le=4_000_000, examples=[BAUDRATE])
    sinc: Whole = Field(default=64, ge=51, le=512, examples=[64])
    ranges: _Ranges | None = Field(default=None, examples=[[*RANGES]])

    def known_ranges(self) -> Wrench:
        """Return the measuring ranges [N, N m]."""
        return self.ranges or RANGES

    def build(self, line: PortSettings) -> BotaDevice:
        """Return the sensor on `line`."""
        settings = BotaSettings(self.sinc, ranges=self.ranges or RANGES)
        return BotaDevice(line, settings)
