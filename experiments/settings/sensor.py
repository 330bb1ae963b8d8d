"""[ft_sensor] of rig.toml: which wrist sensor it is, and how it is set up."""

from typing import Literal, cast

from pydantic import Field, model_validator

from acquisition.errors import SettingsError
from experiments.settings.base import (
    File,
    Mass,
    Number,
    Positive,
    SettingsSection,
    Six,
    Whole,
)
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.sensor import SerialDevice
from ft_sensor.vendors import bota_device, optoforce_device, robotous_device
from ft_sensor.vendors.bota_device import BotaDevice, BotaSettings
from ft_sensor.vendors.optoforce_device import OptoForceDevice, OptoForceSettings
from ft_sensor.vendors.robotous_device import RobotousDevice, RobotousSettings

SensorKind = Literal["bota", "robotous", "optoforce", "barrett"]
_BAUDRATES = {
    "bota": bota_device.BAUDRATE,
    "robotous": robotous_device.BAUDRATE,
    "optoforce": optoforce_device.BAUDRATE,
}
_SIMULATED_CHECK = 0.5  # s; a simulated rate is what it says


class SensorSection(SettingsSection):
    """The wrist sensor and how it is mounted.

    A "barrett" is on the arm's bus, the others have a serial line. What a kind does not
    know is left out: `sinc` and `ranges` are a bota's, `rate` a robotous', `filter_hz`
    of both others, `sensitivity` and `serial_number` an optoforce's.
    """

    kind: SensorKind = Field(examples=["bota"])
    port: str = Field(examples=["/dev/ttyUSB0"])
    baudrate: Whole = Field(gt=0, examples=[460800])
    sinc: Whole = Field(default=64, ge=51, le=512, examples=[64])
    rate: Whole = Field(default=1000, gt=0, examples=[1000])
    filter_hz: Whole = Field(default=150, ge=0, examples=[150])
    sensitivity: Six | None = Field(
        default=None, examples=[[18.28, 18.41, 2.12, 278.72, 259.55, 448.47]]
    )
    serial_number: str | None = Field(
        default=None, min_length=1, max_length=8, examples=["HEX00042"]
    )
    ranges: tuple[Positive, Positive, Positive, Positive, Positive, Positive] | None = (
        Field(default=None, examples=[[500.0, 500.0, 1200.0, 15.0, 15.0, 12.0]])
    )
    mass: Mass = Field(examples=[0.136])
    height: Number = Field(ge=0, le=0.2, examples=[0.012])
    angle_deg: Number = Field(ge=-360, le=360, examples=[0.0])
    sign: Literal[1, -1] = Field(examples=[1])
    calibration: File | None = Field(default=None, examples=["ft_sensor.toml"])

    @property
    def is_on_bus(self) -> bool:
        """Whether it is asked over the arm's bus and has no port."""
        return self.kind == "barrett"

    @model_validator(mode="before")
    @classmethod
    def _fill_line(cls, data: object) -> object:
        given = cast("dict[str, object]", data) if isinstance(data, dict) else {}
        kind = str(given.get("kind"))
        if kind == "barrett":
            return {"port": "none", "baudrate": 1_000_000, **given}
        if kind in _BAUDRATES:
            return {"baudrate": _BAUDRATES[kind], **given}
        return cast("object", data)


def build_device(
    section: SensorSection, *, is_simulated: bool = False
) -> SerialDevice | None:
    """Return the serial sensor that `section` describes; None if it is on the bus.

    Raises:
        SettingsError: something that kind needs is missing, or it cannot do it.
    """
    if section.is_on_bus:
        return None
    port, check = section.port, 2.0
    if is_simulated:
        port, check = "simulated", _SIMULATED_CHECK
    line = PortSettings(port, section.baudrate, check)
    try:
        if section.kind == "bota":
            return _bota(line, section)
        if section.kind == "robotous":
            settings = RobotousSettings(section.rate, section.filter_hz)
            return RobotousDevice(line, settings)
        return _optoforce(line, section)
    except SettingsError as error:
        raise SettingsError(
            f"rig.toml: ft_sensor: {error.message}",
            hint=f"{error.hint} Nothing was started.",
        ) from error


def _bota(line: PortSettings, section: SensorSection) -> BotaDevice:
    ranges = section.ranges or bota_device.RANGES
    return BotaDevice(line, BotaSettings(section.sinc, ranges=ranges))


def _optoforce(line: PortSettings, section: SensorSection) -> OptoForceDevice:
    if section.sensitivity is None or section.serial_number is None:
        raise SettingsError(
            "an optoforce needs sensitivity and serial_number, e.g. sensitivity = "
            '[18.28, 18.41, 2.12, 278.72, 259.55, 448.47], serial_number = "HEX00042".',
            hint="Both stand in the report that came with the unit.",
        )
    settings = OptoForceSettings(
        section.sensitivity, section.serial_number, section.filter_hz
    )
    return OptoForceDevice(line, settings)
