"""Driver part of OptoForce / OnRobot HEX sensors: identity, start-up, settings."""

from dataclasses import dataclass
from math import inf
from typing import Annotated, Literal

from pydantic import Field

from acquisition.clock import NS_PER_S
from acquisition.errors import DeviceFaultError, LinkTimeoutError, SettingsError
from acquisition.settings import Number, UsualRange, Whole
from ft_sensor.reading import Reading, StreamTiming, Wrench
from ft_sensor.section import SensorSection
from ft_sensor.serial_line.framing import FrameScanner, wire_time_ns
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.startup import SerialDialog
from ft_sensor.vendors import optoforce

BAUDRATE = 1_000_000
RATE = 1000  # Hz; 500 would be an undocumented code
_FROZEN_NS = NS_PER_S  # coarse counts may repeat, but not for that long
_ANSWER_NS = NS_PER_S // 2
_LISTEN_NS = NS_PER_S // 2
_TRIES = 3


@dataclass(frozen=True, slots=True)
class OptoForceSettings:
    """Settings of a HEX sensor and the contents of its sensitivity report.

    Attributes:
        sensitivity: counts per N and per N m, from the report of this unit.
        serial_number: serial number in the report.
        filter_hz: cut-off of its low-pass, a key of `optoforce.FILTER_CODES`; 0 = off.
    """

    sensitivity: Wrench
    serial_number: str
    filter_hz: int = 150

    def __post_init__(self) -> None:
        """Validate the settings.

        Raises:
            SettingsError: unknown filter, or a sensitivity of zero.
        """
        if self.filter_hz not in optoforce.FILTER_CODES:
            raise SettingsError(
                f"F/T sensor filter {self.filter_hz} Hz is unknown.",
                hint=f"Use one of {sorted(optoforce.FILTER_CODES)}.",
            )
        if not all(abs(value) > 1e-3 for value in self.sensitivity):
            raise SettingsError(
                "F/T sensor sensitivities must differ from zero.",
                hint="Copy the six numbers of the unit's sensitivity report.",
            )


def _full_range(sensitivity: Wrench) -> Wrench:
    """Return the wrench at full scale [N, N m]; infinite for a sensitivity of zero."""
    fx, fy, fz, tx, ty, tz = (
        abs(optoforce.FULL_COUNTS / value) if value else inf for value in sensitivity
    )
    return fx, fy, fz, tx, ty, tz


class OptoForceDevice:
    """Implements `ft_sensor.serial_line.sensor.SerialDevice` for a HEX sensor.

    Settings cannot be read back: acknowledgement and frame rate are checked.
    """

    stop = optoforce.encode_configuration(optoforce.STOPPED, 0)

    def __init__(self, line: PortSettings, settings: OptoForceSettings) -> None:
        """Set up line and timing; no I/O.

        Raises:
            SettingsError: the line cannot carry the stream.
        """
        period_ns = NS_PER_S / RATE
        line.require((BAUDRATE, 921600, 460800), optoforce.FRAME_SIZE, period_ns)
        self.line = line
        self.ranges = _full_range(settings.sensitivity)
        self.timing = StreamTiming(
            period_ns=period_ns,
            wire_ns=wire_time_ns(optoforce.FRAME_SIZE, line.baudrate),
            modulus=optoforce.COUNTER_MODULUS,
            tick_ns=period_ns,
            frozen_ns=_FROZEN_NS,
            frame_size=optoforce.FRAME_SIZE,
        )
        self._settings = settings

    def scanner(self) -> FrameScanner[Reading]:
        """Return a scanner for the frames of the stream."""
        return optoforce.scanner(self._settings.sensitivity)

    def status_texts(self, status: int) -> tuple[str, ...]:
        """Return the meaning of a status."""
        return optoforce.status_texts(status)

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Check the serial number, configure the sensor and start its stream.

        Raises:
            LinkError: the port failed, or the data are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: not the unit of the report, an older protocol, refused
                settings, or a reported failure.
        """
        dialog.wait_for(lambda: dialog.frames > 0 or None, _LISTEN_NS)
        self._configure(dialog, self.stop)
        serial_number = self._serial_number(dialog)
        cutoff = self._settings.filter_hz
        codes = optoforce.SPEED_CODES[RATE], optoforce.FILTER_CODES[cutoff]
        self._configure(dialog, optoforce.encode_configuration(*codes))
        self._refuse_failure(dialog.first_readings())
        return {
            "model": "OptoForce / OnRobot HEX, 6 axes",
            "serial_number": serial_number,
            "firmware": "unknown (cannot be asked)",
            "filter": f"low-pass {cutoff} Hz" if cutoff else "off",
            "time": "device counter, fitted to arrival less wire time; filter unknown",
        }

    def _serial_number(self, dialog: SerialDialog) -> str:
        for _ in range(_TRIES):
            dialog.write(optoforce.ASK_SERIAL)
            reply = dialog.wait_for(
                lambda: optoforce.find_serial_number(dialog.buffer), _ANSWER_NS
            )
            if reply is not None:
                break
        else:
            raise LinkTimeoutError(
                "The F/T sensor does not report its serial number.",
                hint="Cycle its power. Without it the sensitivities cannot be "
                "assigned to it.",
            )
        if reply != self._settings.serial_number:
            raise DeviceFaultError(
                f"The F/T sensor is {reply}, the sensitivities in rig.toml belong to "
                f"{self._settings.serial_number}.",
                hint="Enter sensitivity and serial_number of its own report.",
            )
        return reply

    def _configure(self, dialog: SerialDialog, command: bytes) -> None:
        for _ in range(_TRIES):
            dialog.write(command)
            code = dialog.wait_for(
                lambda: optoforce.find_configuration_answer(dialog.buffer), _ANSWER_NS
            )
            if code == 0:
                return
            if code is not None:
                raise DeviceFaultError(
                    f"The F/T sensor refused its configuration with code {code}.",
                    hint="Cycle its power; check filter_hz against its manual.",
                )
            if optoforce.is_older_protocol(dialog.buffer):
                raise DeviceFaultError(
                    "The F/T sensor uses an older protocol of its vendor.",
                    hint="Update its firmware.",
                )
        if not dialog.frames:
            dialog.raise_no_reply(self.line.baudrate)
        raise LinkTimeoutError(
            f"The F/T sensor did not answer within {_TRIES * _ANSWER_NS / NS_PER_S:g} "
            "s.",
            hint="Check the cable in both directions; cycle its power.",
        )

    def _refuse_failure(self, readings: list[Reading]) -> None:
        faulty = next((r for r in reversed(readings) if not r.is_trusted), None)
        if faulty is not None:
            words = ", ".join(self.status_texts(faulty.status))
            raise DeviceFaultError(
                f"The F/T sensor reports: {words}.",
                hint="Check the cable between sensor and DAQ; cycle its power.",
            )


_Count = Annotated[
    Number, Field(ge=-5000, le=5000), UsualRange(-1500.0, 1500.0, "counts per N or N m")
]


class OptoForceSection(SensorSection):
    """[ft_sensor] of a HEX sensor; its options are those of `OptoForceSettings`."""

    kind: Literal["optoforce"] = Field(examples=["optoforce"])
    baudrate: Whole = Field(default=BAUDRATE, gt=0, le=4_000_000, examples=[BAUDRATE])
    filter_hz: Whole = Field(default=150, ge=0, le=1000, examples=[150])
    sensitivity: tuple[_Count, _Count, _Count, _Count, _Count, _Count] | None = Field(
        default=None, examples=[[18.28, 18.41, 2.12, 278.72, 259.55, 448.47]]
    )
    serial_number: str | None = Field(
        default=None, min_length=1, max_length=8, examples=["HEX00042"]
    )

    def known_ranges(self) -> Wrench | None:
        """Return the measuring ranges [N, N m], None without sensitivities."""
        return _full_range(self.sensitivity) if self.sensitivity else None

    def build(self, line: PortSettings) -> OptoForceDevice:
        """Return the sensor on `line`.

        Raises:
            SettingsError: sensitivity or serial number is missing.
        """
        if self.sensitivity is None or self.serial_number is None:
            raise SettingsError(
                "an optoforce needs sensitivity and serial_number, e.g. sensitivity = "
                "[18.28, 18.41, 2.12, 278.72, 259.55, 448.47], serial_number = "
                '"HEX00042".',
                hint="Both stand in the report that came with the unit.",
            )
        settings = OptoForceSettings(
            self.sensitivity, self.serial_number, self.filter_hz
        )
        return OptoForceDevice(line, settings)
