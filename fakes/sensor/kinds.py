"""Choice of the simulated wrist sensor, by the names in rig.toml."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fakes.sensor.ati import COUNTS, AtiOptions, ati_stream
from fakes.sensor.bota import BotaOptions, bota_stream
from fakes.sensor.errors import SensorErrors
from fakes.sensor.network import UdpDevice
from fakes.sensor.optoforce import (
    SENSITIVITY,
    SERIAL_NUMBER,
    OptoForceOptions,
    optoforce_stream,
)
from fakes.sensor.pty import SerialPty
from fakes.sensor.robotous import RobotousOptions, robotous_stream
from fakes.sensor.stream import SensorStream, Source
from ft_sensor.reading import Wrench

DRIFT_PPM = 20.0  # rate error of the device's clock; crystals differ


@dataclass(frozen=True, slots=True)
class SensorChoice:
    """A wrist sensor as described by rig.toml.

    Attributes:
        kind: "bota", "robotous", "optoforce", "ati" on the network, or "barrett" on the
            arm's bus.
        sinc: filter length with which a bota is already running.
        baudrate: speed of the line [bit/s]; None = the default of the kind.
        sensitivity: of an optoforce [counts/N, counts/N m]; None = the fake's default.
        serial_number: of an optoforce; None = the fake's default.
        rate: of an ati [Hz].
        counts_per_force: of an ati [counts/N]; None = the fake's default.
        counts_per_torque: of an ati [counts/N m]; None = the fake's default.
    """

    kind: str = "bota"
    sinc: int = 64
    baudrate: int | None = None
    sensitivity: Wrench | None = None
    serial_number: str | None = None
    rate: int = 1000
    counts_per_force: float | None = None
    counts_per_torque: float | None = None

    @property
    def is_on_bus(self) -> bool:
        """Whether it is a node of the arm's bus."""
        return self.kind == "barrett"


def make_stream(
    choice: SensorChoice, source: Source, errors: SensorErrors | None, t_ns: int
) -> SensorStream:
    """Return a sensor that is already running at `t_ns`.

    For a sensor on the bus this is the stream of a bota without a reader.
    """
    maker = _bota if choice.is_on_bus else _MAKERS[choice.kind]
    return maker(choice, source, errors, t_ns)


def _bota(
    choice: SensorChoice, source: Source, errors: SensorErrors | None, t_ns: int
) -> SensorStream:
    options = BotaOptions(
        is_running=True,
        sinc=choice.sinc,
        baudrate=choice.baudrate or BotaOptions().baudrate,
        clock_error_ppm=DRIFT_PPM,
    )
    return bota_stream(source, errors, options, t_ns)


def _robotous(
    choice: SensorChoice, source: Source, errors: SensorErrors | None, t_ns: int
) -> SensorStream:
    options = RobotousOptions(
        is_running=True,
        baudrate=choice.baudrate or RobotousOptions().baudrate,
        clock_error_ppm=DRIFT_PPM,
    )
    return robotous_stream(source, errors, options, t_ns)


def _optoforce(
    choice: SensorChoice, source: Source, errors: SensorErrors | None, t_ns: int
) -> SensorStream:
    options = OptoForceOptions(
        serial_number=choice.serial_number or SERIAL_NUMBER,
        sensitivity=choice.sensitivity or SENSITIVITY,
        is_running=True,
        baudrate=choice.baudrate or OptoForceOptions().baudrate,
        clock_error_ppm=DRIFT_PPM,
    )
    return optoforce_stream(source, errors, options, t_ns)


def _ati(
    choice: SensorChoice, source: Source, errors: SensorErrors | None, t_ns: int
) -> SensorStream:
    force, torque = choice.counts_per_force, choice.counts_per_torque
    options = AtiOptions(
        counts=(force or COUNTS[0], torque or COUNTS[1]),
        rate=choice.rate,
        is_running=True,
        baudrate=choice.baudrate or AtiOptions().baudrate,
        clock_error_ppm=DRIFT_PPM,
    )
    return ati_stream(source, errors, options, t_ns)


_Maker = Callable[
    [SensorChoice, Source, SensorErrors | None, int],
    SensorStream,
]
_MAKERS: dict[str, _Maker] = {
    "bota": _bota,
    "robotous": _robotous,
    "optoforce": _optoforce,
    "ati": _ati,
}
SERIAL_KINDS = tuple(_MAKERS)


def plug(
    choice: SensorChoice, stream: SensorStream, t_ns: int, link: Path | None
) -> SerialPty | UdpDevice:
    """Return the device's end of the sensor's line: a serial port or the network.

    Args:
        choice: the sensor.
        stream: its output.
        t_ns: time of plugging in.
        link: persistent path of the line; on the network its last part may be
            ADDRESS:PORT, otherwise any free port is used.

    Raises:
        OSError: the name or the port is taken.
    """
    if choice.kind != "ati":
        return SerialPty(stream, t_ns, link)
    _, _, port = (link.name if link is not None else "").partition(":")
    return UdpDevice(stream, t_ns, int(port) if port.isdecimal() else 0)
