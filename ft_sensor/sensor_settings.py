"""How a Bota serial sensor is connected and set up."""

from dataclasses import dataclass

from acquisition.clock import NS_PER_S
from acquisition.errors import SettingsError
from ft_sensor import bota


@dataclass(frozen=True, slots=True)
class SensorSettings:
    """How a Bota serial sensor is connected and set up.

    Attributes:
        port: path of the serial device.
        baudrate: speed of the line, one of `bota.BAUD_CODES` [bit/s].
        sinc: sinc filter length; the rate is 51200 / sinc [Hz].
        is_fir_on: FIR filter on: cut-off 189 Hz at sinc 64, without it 1255 Hz.
        rate_check: how long the rate is measured after the start [s].
    """

    port: str
    baudrate: int = 460800
    sinc: int = 64
    is_fir_on: bool = True
    rate_check: float = 2.0

    def __post_init__(self) -> None:
        """Refuse what no sensor can do.

        Raises:
            SettingsError: unknown speed, sinc length out of range, or a line too slow
                for the frames.
        """
        if self.baudrate not in bota.BAUD_CODES:
            raise SettingsError(
                f"F/T sensor speed {self.baudrate} baud is unknown.",
                hint=f"Use one of {sorted(bota.BAUD_CODES)}.",
            )
        if not 1 <= self.sinc <= 512 or not 0.1 <= self.rate_check <= 60:
            raise SettingsError(
                f"F/T sensor sinc length {self.sinc} (1 to 512) or rate check "
                f"{self.rate_check} s (0.1 to 60) is out of range.",
                hint="Sinc 64 gives 800 Hz.",
            )
        if self.wire_ns > self.period_ns:
            raise SettingsError(
                f"{self.baudrate} baud carries {NS_PER_S / self.wire_ns:.0f} F/T "
                f"frames a second, sinc {self.sinc} sends {self.rate:.0f}.",
                hint="Raise the speed of the line or the sinc length.",
            )

    @property
    def period_ns(self) -> float:
        """Time between two samples [ns]."""
        return bota.frame_period_ns(self.sinc)

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return NS_PER_S / self.period_ns

    @property
    def wire_ns(self) -> int:
        """Time one frame needs on the line [ns]."""
        return bota.wire_time_ns(bota.FRAME_SIZE, self.baudrate)
