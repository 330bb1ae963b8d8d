"""A Robotous RFT sensor: identified, set up, read back, started."""

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
_FIRST_BAUDRATE = 115200  # as it leaves the factory, at 200 Hz
_MOST_BY_BAUDRATE = {57600: 200, 115200: 333, 230400: 500, 460800: 500, 921600: 1000}
_FROZEN_NS = NS_PER_S  # its counts may repeat for a while, not so long
_ANSWER_NS = NS_PER_S // 2
_QUIET_NS = 50_000_000
_TRIES = 3
_ABSURD = 1.5  # times the rated load: no measurement


@dataclass(frozen=True, slots=True)
class RobotousSettings:
    """How a Robotous sensor is set up.

    Attributes:
        rate: samples per second, 500 or 1000 [Hz].
        filter_hz: cut-off of its low-pass, a key of `robotous.FILTER_CODES`; 0 = off.
    """

    rate: int = 1000
    filter_hz: int = 150

    def __post_init__(self) -> None:
        """Refuse what the sensor does not know, or what is too slow for the loop.

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

    It has no clock and no counter. Its scale follows from its model, which is asked.
    """

    stop = robotous.encode_command(robotous.STOP)

    def __init__(self, line: PortSettings, settings: RobotousSettings) -> None:
        """Take line and settings.

        Raises:
            SettingsError: the line cannot carry the stream.
        """
        period_ns = NS_PER_S / settings.rate
        # A sensor fresh from the factory has to be spoken to in its own speed once.
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

    def status_words(self, status: int) -> tuple[str, ...]:
        """Return what the overload bits say."""
        return robotous.status_words(status)

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Stop the sensor, identify it, set it up, read that back, start its stream.

        Raises:
            LinkError: the port failed, or bytes came that are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: it is an unknown model, too slow a model, or refused a
                setting; or it spoke at the factory's speed and needs its power cycled.
        """
        self._make_quiet(dialog)
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
        self._refuse_absurd(dialog.first_readings())
        low_pass = f"low-pass {self._settings.filter_hz} Hz"
        return {
            **fields,
            "filter": low_pass if self._settings.filter_hz else "off",
            "overloads": " ".join(map(str, overloads[:6])),
            "time": "frames counted, fitted to arrival less wire time; no device clock",
        }

    def _make_quiet(self, dialog: SerialDialog) -> None:
        """End a stream that an earlier program left; this command has no answer."""
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
        reply = _model_of(name)
        if reply is None:
            raise DeviceFaultError(
                f"The F/T sensor reports the name '{name}', whose scale is unknown.",
                hint=f"Known are {', '.join(MODELS)}.",
            )
        if reply.most_hz < self._settings.rate:
            raise DeviceFaultError(
                f"A {name} sends {reply.most_hz} Hz at most; the loop needs 500.",
                hint="Use another model.",
            )
        self._model, self.ranges = reply, reply.ranges
        return name

    def _leave_first_baudrate(self, dialog: SerialDialog) -> None:
        """Let the sensor speak faster from its next power-on; raises in any case."""
        self._set(dialog, robotous.SET_BAUDRATE, robotous.BAUD_CODES[BAUDRATE])
        raise DeviceFaultError(
            f"At {_FIRST_BAUDRATE} baud the F/T sensor is too slow for the loop. It "
            f"was set to {BAUDRATE} baud from its next power-on.",
            hint=f"Cycle its power and set baudrate = {BAUDRATE} in rig.toml.",
        )

    def _set_filter(self, dialog: SerialDialog) -> None:
        cutoff = self._settings.filter_hz
        wished = (1, robotous.FILTER_CODES[cutoff]) if cutoff else (0, 0)
        self._set(dialog, robotous.SET_FILTER, *wished)
        got = self._ask(dialog, robotous.GET_FILTER)
        if (got[0], got[1] if got[0] else 0) != wished:
            raise _not_taken("filter", wished, tuple(got[:2]))

    def _set_rate(self, dialog: SerialDialog) -> None:
        wished = robotous.RATE_CODES[self._settings.rate]
        self._set(dialog, robotous.SET_RATE, wished)
        got = self._ask(dialog, robotous.GET_RATE)
        if got[0] != wished:
            raise _not_taken("rate", (wished,), (got[0],))

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
        """Return the 15 bytes of the answer to `command`.

        Raises:
            LinkTimeoutError: it did not come, several times.
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

    def _refuse_absurd(self, readings: list[Reading]) -> None:
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
    """Return what is known of a model that calls itself `name`."""
    plain = name.upper().replace(" ", "")
    for known, model in MODELS.items():
        if plain.startswith(known):
            return model
    return None


def _not_taken(
    what: str, wished: tuple[int, ...], got: tuple[int, ...]
) -> DeviceFaultError:
    return DeviceFaultError(
        f"The F/T sensor reads back {what} code {got}, set was {wished}.",
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
