"""Driver part of Robotous RFT sensors: identification, start-up, settings."""

from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from acquisition.clock import NS_PER_S
from acquisition.errors import DeviceFaultError, LinkTimeoutError, SettingsError
from acquisition.settings import Whole
from ft_sensor.reading import Reading, StreamTiming, Wrench
from ft_sensor.section import SensorSection
from ft_sensor.serial_line.framing import FrameScanner, wire_time_ns
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.startup import SerialDialog
from ft_sensor.vendors import robotous
from ft_sensor.vendors.robotous import FIRMWARE, MODEL, MODELS, SERIAL, RobotousModel

BAUDRATE = 921600
_FIRST_BAUDRATE = 115200  # factory setting, at 200 Hz
_MOST_BY_BAUDRATE = {57600: 200, 115200: 333, 230400: 500, 460800: 500, 921600: 1000}
_FROZEN_NS = NS_PER_S  # coarse counts may repeat, but not for that long
_ANSWER_NS = NS_PER_S // 2
_QUIET_NS = 50_000_000
_TRIES = 3
_ABSURD = 1.5  # multiple of the rated load that is implausible at the start


@dataclass(frozen=True, slots=True)
class RobotousSettings:
    """Settings of a Robotous sensor.

    Attributes:
        rate: samples per second, 500 or 1000 [Hz].
        filter_hz: cut-off of its low-pass, a key of `robotous.FILTER_CODES`; 0 = off.
    """

    rate: int = 1000
    filter_hz: int = 150

    def __post_init__(self) -> None:
        """Validate the settings.

        Raises:
            SettingsError: unknown rate or filter.
        """
        if self.rate not in (500, 1000):
            raise SettingsError(
                f"F/T sensor rate {self.rate} Hz - expected 500 or 1000.",
                hint="Prefer 1000: two clocks of 500 Hz slip.",
            )
        if self.filter_hz and self.filter_hz not in robotous.FILTER_CODES:
            raise SettingsError(
                f"F/T sensor filter {self.filter_hz} Hz is unknown.",
                hint=f"Use 0 or one of {sorted(robotous.FILTER_CODES)}.",
            )


class RobotousDevice:
    """Implements `ft_sensor.serial_line.sensor.SerialDevice` for a Robotous sensor.

    The sensor has no clock and no counter. Its scale follows from its model, which is
    read at the start.
    """

    stop = robotous.encode_command(robotous.STOP)

    def __init__(self, line: PortSettings, settings: RobotousSettings) -> None:
        """Set up line and timing; no I/O.

        Raises:
            SettingsError: the line cannot carry the stream.
        """
        period_ns = NS_PER_S / settings.rate
        # A new sensor has to be configured once at its factory speed.
        is_first = line.baudrate == _FIRST_BAUDRATE
        needed_ns = NS_PER_S / 200 if is_first else period_ns
        line.require(tuple(robotous.BAUD_CODES), robotous.FRAME_SIZE, needed_ns)
        if not is_first and settings.rate > _MOST_BY_BAUDRATE[line.baudrate]:
            raise SettingsError(
                f"A Robotous sensor sends {_MOST_BY_BAUDRATE[line.baudrate]} Hz at "
                f"most over {line.baudrate} baud, {settings.rate} are asked for.",
                hint="Set baudrate = 921600.",
            )
        self.line = line
        self.ranges: Wrench = MODELS["RFT60-HA01"].ranges
        self.timing = StreamTiming(
            period_ns=period_ns,
            wire_ns=wire_time_ns(robotous.FRAME_SIZE, line.baudrate),
            modulus=0,
            tick_ns=period_ns,
            frozen_ns=_FROZEN_NS,
            frame_size=robotous.FRAME_SIZE,
        )
        self._settings = settings
        self._model = MODELS["RFT60-HA01"]

    def scanner(self) -> FrameScanner[Reading]:
        """Return a scanner for the frames of the stream."""
        return robotous.scanner(lambda: self._model.torque_counts)

    def status_texts(self, status: int) -> tuple[str, ...]:
        """Return the meanings of the overload bits."""
        return robotous.status_texts(status)

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Stop and identify the sensor, configure it, verify, and start its stream.

        Raises:
            LinkError: the port failed, or the data are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: unknown or too slow model, refused setting, or a speed
                changed from the factory's, which takes a power cycle.
        """
        self._stop_stream(dialog)
        name = self._identify(dialog)
        fields = {
            "model": f"Robotous {name}",
            "serial_number": self._text(dialog, SERIAL),
            "firmware": self._text(dialog, FIRMWARE),
        }
        if self.line.baudrate == _FIRST_BAUDRATE:
            self._leave_first_baudrate(dialog)
        self._set_filter(dialog)
        self._set_rate(dialog)
        overloads = self._ask(dialog, robotous.OVERLOADS)
        dialog.write(robotous.encode_command(robotous.STREAM))
        self._check_plausible(dialog.first_readings())
        low_pass = f"low-pass {self._settings.filter_hz} Hz"
        return {
            **fields,
            "filter": low_pass if self._settings.filter_hz else "off",
            "overloads": " ".join(map(str, overloads[:6])),
            "time": "frames counted, fitted to arrival less wire time; no device clock",
        }

    def _stop_stream(self, dialog: SerialDialog) -> None:
        """Stop a stream left by an earlier program; this command has no reply."""
        dialog.write(self.stop)
        dialog.pause(_QUIET_NS)
        dialog.discard()

    def _identify(self, dialog: SerialDialog) -> str:
        try:
            name = self._text(dialog, MODEL)
        except LinkTimeoutError:
            if not dialog.frames:
                dialog.raise_no_reply(self.line.baudrate)
            raise
        model = _model_of(name)
        if model is None:
            raise DeviceFaultError(
                f"The F/T sensor reports the name '{name}', whose scale is unknown.",
                hint=f"Known are {', '.join(MODELS)}.",
            )
        if model.most_hz < self._settings.rate:
            raise DeviceFaultError(
                f"A {name} sends {model.most_hz} Hz at most; the loop needs 500.",
                hint="Use another model.",
            )
        self._model, self.ranges = model, model.ranges
        return name

    def _leave_first_baudrate(self, dialog: SerialDialog) -> None:
        """Set a higher speed for the next power-on; always raises."""
        self._set(dialog, robotous.SET_BAUDRATE, robotous.BAUD_CODES[BAUDRATE])
        raise DeviceFaultError(
            f"At {_FIRST_BAUDRATE} baud the F/T sensor is too slow for the loop. It "
            f"was set to {BAUDRATE} baud from its next power-on.",
            hint=f"Cycle its power and set baudrate = {BAUDRATE} in rig.toml.",
        )

    def _set_filter(self, dialog: SerialDialog) -> None:
        cutoff = self._settings.filter_hz
        requested = (1, robotous.FILTER_CODES[cutoff]) if cutoff else (0, 0)
        self._set(dialog, robotous.SET_FILTER, *requested)
        readback = self._ask(dialog, robotous.GET_FILTER)
        if (readback[0], readback[1] if readback[0] else 0) != requested:
            raise _readback_error("filter", requested, tuple(readback[:2]))

    def _set_rate(self, dialog: SerialDialog) -> None:
        requested = robotous.RATE_CODES[self._settings.rate]
        self._set(dialog, robotous.SET_RATE, requested)
        readback = self._ask(dialog, robotous.GET_RATE)
        if readback[0] != requested:
            raise _readback_error("rate", (requested,), (readback[0],))

    def _set(self, dialog: SerialDialog, command: int, *parameters: int) -> None:
        answer = self._ask(dialog, command, *parameters)
        if answer[0] != 1:
            reason = robotous.ERRORS.get(answer[1], f"error {answer[1]}")
            raise DeviceFaultError(
                f"The F/T sensor refused command {command:#04x} "
                f"{' '.join(map(str, parameters))}: {reason}.",
                hint="Check rate, filter and speed against its manual.",
            )

    def _text(self, dialog: SerialDialog, command: int) -> str:
        return robotous.text_of(self._ask(dialog, command))

    def _ask(self, dialog: SerialDialog, command: int, *parameters: int) -> bytes:
        """Return the 15 bytes of the reply to `command`, with retries.

        Raises:
            LinkTimeoutError: no reply.
        """
        for _ in range(_TRIES):
            dialog.write(robotous.encode_command(command, *parameters))
            reply = dialog.wait_for(
                lambda: robotous.find_answer(dialog.buffer, command), _ANSWER_NS
            )
            if reply is not None:
                return reply
        raise LinkTimeoutError(
            f"The F/T sensor did not answer command {command:#04x} within "
            f"{_TRIES * _ANSWER_NS / NS_PER_S:g} s.",
            hint="Check the cable in both directions; cycle its power.",
        )

    def _check_plausible(self, readings: list[Reading]) -> None:
        worst = max(
            abs(value) / rated
            for reading in readings
            for value, rated in zip(reading.wrench, self.ranges, strict=True)
        )
        if worst > _ABSURD:
            raise DeviceFaultError(
                f"The F/T sensor shows {worst:.1f} times its rated load.",
                hint="Take the load off; if none is on it, its gauges are damaged.",
            )


def _model_of(name: str) -> RobotousModel | None:
    """Return the model of a reported `name`, or None."""
    plain = name.upper().replace(" ", "")
    for model_name, model in MODELS.items():
        if plain.startswith(model_name):
            return model
    return None


def _readback_error(
    what: str, requested: tuple[int, ...], readback: tuple[int, ...]
) -> DeviceFaultError:
    return DeviceFaultError(
        f"The F/T sensor reads back {what} code {readback}, set was {requested}.",
        hint="Cycle its power and try again; check its firmware.",
    )


class RobotousSection(SensorSection):
    """[ft_sensor] of a Robotous sensor; its options are those of `RobotousSettings`."""

    kind: Literal["robotous"] = Field(examples=["robotous"])
    baudrate: Whole = Field(default=BAUDRATE, gt=0, le=4_000_000, examples=[BAUDRATE])
    rate: Whole = Field(default=1000, gt=0, le=2000, examples=[1000])
    filter_hz: Whole = Field(default=150, ge=0, le=1000, examples=[150])

    def build(self, line: PortSettings) -> RobotousDevice:
        """Return the sensor at the end of `line`."""
        return RobotousDevice(line, RobotousSettings(self.rate, self.filter_hz))
