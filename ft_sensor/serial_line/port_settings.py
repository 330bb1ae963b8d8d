"""How a serial wrist sensor is connected."""

from dataclasses import dataclass

from acquisition.clock import NS_PER_S
from acquisition.errors import SettingsError
from ft_sensor.serial_line.framing import wire_time_ns


@dataclass(frozen=True, slots=True)
class Line:
    """A serial line and how its stream is checked.

    Attributes:
        port: path of the serial device.
        baudrate: speed of the line [bit/s].
        rate_check: how long the rate is measured after the start [s].
    """

    port: str
    baudrate: int
    rate_check: float = 2.0

    def require(self, baudrates: tuple[int, ...], size: int, period_ns: float) -> None:
        """Refuse a line that cannot carry the stream.

        Args:
            baudrates: speeds the sensor knows [bit/s].
            size: of a frame [bytes].
            period_ns: between two of them [ns].

        Raises:
            SettingsError: unknown speed, a line too slow for the frames, or a check
                that is too short or too long.
        """
        if self.baudrate not in baudrates:
            raise SettingsError(
                f"F/T sensor speed {self.baudrate} baud is unknown.",
                hint=f"Use one of {sorted(baudrates)}.",
            )
        if not 0.1 <= self.rate_check <= 60:
            raise SettingsError(
                f"F/T sensor rate check of {self.rate_check} s is out of range.",
                hint="0.1 to 60 s; 2 s are usual.",
            )
        wire_ns = wire_time_ns(size, self.baudrate)
        if wire_ns > period_ns:
            raise SettingsError(
                f"{self.baudrate} baud carries {NS_PER_S / wire_ns:.0f} F/T frames a "
                f"second, the sensor is to send {NS_PER_S / period_ns:.0f}.",
                hint="Raise the speed of the line or lower the rate.",
            )
