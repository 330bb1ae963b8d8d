"""[ft_sensor] of rig.toml: what every make of sensor has."""

from typing import Literal

from pydantic import Field

from acquisition.settings import File, Mass, Number, SettingsSection, Whole
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.sensor import SerialDevice


class SensorSection(SettingsSection):
    """The line of the wrist sensor and how it is mounted.

    A make adds `kind`, the usual speed of its line, and options of its own.
    """

    port: str = Field(examples=["/dev/ttyUSB0"])
    baudrate: Whole = Field(gt=0, examples=[460800])
    mass: Mass = Field(examples=[0.136])
    height: Number = Field(ge=0, le=0.2, examples=[0.012])
    angle_deg: Number = Field(ge=-360, le=360, examples=[0.0])
    sign: Literal[1, -1] = Field(examples=[1])
    calibration: File | None = Field(default=None, examples=["ft_sensor.toml"])

    @property
    def is_on_bus(self) -> bool:
        """Whether it is asked over the arm's bus and has no port."""
        return False

    def build(self, line: PortSettings) -> SerialDevice | None:
        """Return the serial sensor at the end of `line`; None if it is on the bus.

        Raises:
            SettingsError: something that the make needs is missing, or cannot be.
        """
        raise NotImplementedError
