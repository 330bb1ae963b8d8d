"""The wrist sensor as the loop sees it: opened, polled, closed."""

import contextlib
from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.devices import WrenchSample
from acquisition.errors import TractionError
from ft_sensor import bota
from ft_sensor.bota import BootText, BotaParser
from ft_sensor.bota_start import BotaStart, StartedBota
from ft_sensor.dating import FrameDating
from ft_sensor.sensor_settings import SensorSettings
from ft_sensor.serial_link import SerialLink


@dataclass(frozen=True, slots=True)
class SensorCounters:
    """What happened to the stream since it was opened.

    Attributes:
        frames: good frames.
        crc_errors: failed checksums.
        discarded: bytes that belong to no good frame.
        resyncs: times the stream was lost.
        lost: frames missing by the device's clock.
        frozen: frames whose numbers or clock stood still.
    """

    frames: int
    crc_errors: int
    discarded: int
    resyncs: int
    lost: int
    frozen: int


class BotaSensor:
    """A Bota sensor of generation 1 on a serial line.

    Implements `acquisition.devices.WrenchSensor`. Poll it at least ten times a second:
    the kernel keeps 0.1 s of the stream, and what is read late is dated late.
    """

    def __init__(
        self, link: SerialLink, clock: Clock, settings: SensorSettings
    ) -> None:
        self._link = link
        self._clock = clock
        self._settings = settings
        self._parser = BotaParser()
        self._dating = FrameDating(settings)
        self._started = StartedBota(BootText(), rate=0.0)

    def open(self) -> None:
        """Set the sensor up, start its stream and measure its rate.

        Raises:
            LinkError: the port failed, or bytes came that are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: it refused a command, its calibration matrix stays
                inactive, or its rate is below 495 Hz.
        """
        self._parser = BotaParser()
        start = BotaStart(self._link, self._clock, self._settings, self._parser)
        self._started = start.run()
        self._parser.counters = bota.ParserCounters()
        self._dating = FrameDating(self._settings)

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return what has arrived since the last call, oldest first; does not wait.

        Raises:
            LinkError: the port is closed or gone.
        """
        data = self._link.read_available()
        return self._dating.date(self._parser.feed(data), now_ns) if data else []

    def fileno(self) -> int:
        """Return the descriptor of the port, -1 if it has none."""
        return self._link.fileno()

    def is_readable(self) -> bool:
        """Return whether bytes have arrived."""
        return self._link.is_readable()

    @property
    def counters(self) -> SensorCounters:
        """What happened to the stream since it was opened."""
        parsed = self._parser.counters
        return SensorCounters(
            parsed.frames,
            parsed.crc_errors,
            parsed.discarded,
            parsed.resyncs,
            self._dating.lost,
            self._dating.frozen,
        )

    def describe(self) -> dict[str, str]:
        """Return what the sensor is and how it is set up, as text."""
        settings, boot = self._settings, self._started.boot
        fir = "on" if settings.is_fir_on else "off"
        unknown = "unknown (no boot text seen)"
        return {
            "model": "Bota serial, generation 1",
            "name": boot.name or unknown,
            "serial_number": boot.serial_number or unknown,
            "firmware": boot.firmware or unknown,
            "port": settings.port,
            "baudrate": str(settings.baudrate),
            "filter": f"sinc {settings.sinc}, FIR {fir}",
            "nominal_rate": f"{settings.rate:.1f} Hz",
            "measured_rate": f"{self._started.rate:.1f} Hz",
            "time": "device clock, fitted to arrival less wire time; filter unknown",
        }

    def close(self) -> None:
        """Stop the stream and give the port back; never raises."""
        # A port that is gone or closed has no stream to stop.
        with contextlib.suppress(TractionError):
            self._link.write(bota.CONFIGURE)
        self._link.close()
