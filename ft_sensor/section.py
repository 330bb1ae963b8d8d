"""Section [ft_sensor] of rig.toml: settings common to all makes."""

from typing import Annotated, Literal

from pydantic import Field

from acquisition.settings import File, Number, SettingsSection, UsualRange, Whole
from ft_sensor.reading import Wrench
from ft_sensor.serial_line.link import OpenedPort, PortSettings, open_port
from ft_sensor.serial_line.sensor import SerialDevice


class SensorSection(SettingsSection):
    """Serial line and mounting of the wrist sensor.

    A make adds `kind`, a default speed of its line, and its own options.
    """

    port: str = Field(examples=["/dev/ttyUSB0"])
    baudrate: Whole = Field(gt=0, le=4_000_000, examples=[460800])
    mass: Annotated[Number, UsualRange(0.03, 0.4, "kg")] = Field(
        ge=0.01, le=1.0, examples=[0.136]
    )
    height: Annotated[Number, UsualRange(0.0, 0.06, "m")] = Field(
        ge=0, le=0.1, examples=[0.012]
    )
    angle_deg: Annotated[Number, UsualRange(-180.0, 180.0, "degrees")] = Field(
        ge=-360, le=360, examples=[0.0]
    )
    sign: Literal[1, -1] = Field(examples=[1])
    calibration: File | None = Field(default=None, examples=["ft_sensor.toml"])

    @property
    def is_on_bus(self) -> bool:
        """Whether the sensor is polled on the arm's bus and has no port."""
        return False

    def known_ranges(self) -> Wrench | None:
        """Return the measuring ranges [N, N m]; None = read from the sensor."""
        return None

    def open_port(self, port: str) -> OpenedPort:
        """Open the serial device at the path `port`; raises LinkError."""
        return open_port(port, self.baudrate)

    def build(self, line: PortSettings) -> SerialDevice | None:
        """Return the serial sensor on `line`; None if it is on the arm's bus.

        Raises:
            SettingsError: a setting of the make is missing or invalid.
        """
        raise NotImplementedError
