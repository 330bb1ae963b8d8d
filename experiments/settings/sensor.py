"""Build the wrist sensor of rig.toml."""

from acquisition.errors import SettingsError
from ft_sensor.section import SensorSection
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.sensor import SerialDevice

_SIMULATED_CHECK = 0.5  # s, since a simulated rate is exact


def build_device(
    section: SensorSection, *, is_simulated: bool = False
) -> SerialDevice | None:
    """Return the serial sensor that `section` describes; None if it is on the bus.

    Raises:
        SettingsError: an option of that kind is missing or invalid.
    """
    line = PortSettings(section.port, section.baudrate)
    if is_simulated:
        line = PortSettings("simulated", section.baudrate, _SIMULATED_CHECK)
    try:
        return section.build(line)
    except SettingsError as error:
        raise SettingsError(
            f"rig.toml: ft_sensor: {error.message}",
            hint=f"{error.hint} Nothing was started.",
        ) from error
