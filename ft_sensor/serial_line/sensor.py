"""A serial wrist sensor as the loop sees it: opened, polled, closed."""

import contextlib
from dataclasses import asdict, dataclass
from typing import Protocol

from acquisition.clock import NS_PER_S, Clock
from acquisition.devices import WrenchSample
from acquisition.errors import TractionError
from ft_sensor.reading import Reading, StreamTiming, Wrench, is_measurable
from ft_sensor.serial_line.framing import FrameScanner, ScanCounters
from ft_sensor.serial_line.link import PortSettings, SerialLink
from ft_sensor.serial_line.startup import SerialDialog
from ft_sensor.serial_line.timestamps import SampleTimestamper

BURST_NS = 5_000_000  # of a stream read at once: an adapter collects bytes
BURSTY = 0.1  # share of the reads


class SerialDevice(Protocol):
    """One make of serial sensor: its frames, its opening ritual, its words.

    Attributes:
        line: where it is connected.
        timing: how its frames follow each other.
        ranges: fx fy fz tx ty tz it measures up to [N, N m].
        stop: bytes that end its stream.
    """

    line: PortSettings
    timing: StreamTiming
    ranges: Wrench
    stop: bytes

    def scanner(self) -> FrameScanner[Reading]:
        """Return a scanner for the frames of the stream."""
        ...

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Set it up and start its stream; return who it is and how it is set."""
        ...

    def status_words(self, status: int) -> tuple[str, ...]:
        """Return what the set bits of `status` say."""
        ...


@dataclass(frozen=True, slots=True)
class SensorCounters:
    """What happened to the stream since it was opened.

    Attributes:
        frames: good frames.
        bad_checks: headers whose frame failed its checks.
        discarded: bytes that belong to no good frame.
        resyncs: times the stream was lost.
        lost: samples missing by the device's clock or count.
        jumps: times the device's clock did not show time that had passed.
        frozen: frames whose numbers or clock stood still.
        bursts: reads that brought more than 5 ms of the stream at once.
        reads: reads that brought something.
    """

    frames: int
    bad_checks: int
    discarded: int
    resyncs: int
    lost: int
    jumps: int
    frozen: int
    bursts: int
    reads: int

    @property
    def is_bursty(self) -> bool:
        """Whether the adapter collects bytes before it delivers them."""
        return self.bursts > BURSTY * self.reads

    def metadata(self) -> dict[str, str]:
        """Return the counts as text for the recording."""
        return {name: str(value) for name, value in asdict(self).items()}


class SerialSensor:
    """A wrist sensor on a serial line.

    Implements `acquisition.devices.WrenchSensor`. Poll it as soon as bytes are there:
    the kernel keeps 0.1 s of the stream, and what is read late looks like a burst.
    """

    def __init__(self, link: SerialLink, clock: Clock, device: SerialDevice) -> None:
        self._link = link
        self._clock = clock
        self.device = device
        self._facts: dict[str, str] = {}
        self._rate = 0.0
        self._begin(device.scanner())

    def open(self) -> None:
        """Set the sensor up, start its stream and measure its rate.

        Raises:
            LinkError: the port failed, or bytes came that are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: it refused a setting, its numbers cannot be
                trusted, or its rate is below 495 Hz.
        """
        device, scanner = self.device, self.device.scanner()
        dialog = SerialDialog(self._link, self._clock, scanner)
        self._facts = device.start(dialog)
        self._rate = dialog.measure_rate(device.timing, device.line.rate_check)
        scanner.counters = ScanCounters()
        self._begin(scanner)

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return what has arrived since the last call, oldest first; does not wait.

        Raises:
            LinkError: the port is closed or gone.
        """
        data = self._link.read_available()
        if not data:
            return []
        scanned = self._scanner.counters
        before = scanned.discarded
        readings = self._scanner.feed(data)
        for reading in readings:
            if not is_measurable(reading.wrench, self.device.ranges):
                reading.is_trusted = False  # whatever its checksum says
        if readings:
            self._reads += 1
            self._bursts += len(readings) > self._most_at_once
        return self._timestamper.date(readings, now_ns, scanned.discarded - before)

    def fileno(self) -> int:
        """Return the descriptor of the port, -1 if it has none."""
        return self._link.fileno()

    def is_readable(self) -> bool:
        """Return whether bytes have arrived."""
        return self._link.is_readable()

    @property
    def counters(self) -> SensorCounters:
        """What happened to the stream since it was opened."""
        scanned, dated = self._scanner.counters, self._timestamper
        return SensorCounters(
            frames=scanned.frames,
            bad_checks=scanned.bad_checks,
            discarded=scanned.discarded,
            resyncs=scanned.resyncs,
            lost=dated.lost,
            jumps=dated.jumps,
            frozen=dated.frozen,
            bursts=self._bursts,
            reads=self._reads,
        )

    def describe(self) -> dict[str, str]:
        """Return what the sensor is and how it is set up, as text."""
        device = self.device
        return {
            **self._facts,
            "port": device.line.port,
            "baudrate": str(device.line.baudrate),
            "ranges": " ".join(f"{most:g}" for most in device.ranges),
            "nominal_rate": f"{NS_PER_S / device.timing.period_ns:.1f} Hz",
            "measured_rate": f"{self._rate:.1f} Hz",
        }

    def stream_metadata(self) -> dict[str, str]:
        """Return what became of the stream since it was opened, as text."""
        return self.counters.metadata()

    def close(self) -> None:
        """Stop the stream and give the port back; never raises."""
        # A port that is gone or closed has no stream to stop.
        with contextlib.suppress(TractionError):
            self._link.write(self.device.stop)
        self._link.close()

    def _begin(self, scanner: FrameScanner[Reading]) -> None:
        timing = self.device.timing
        self._scanner = scanner
        self._timestamper = SampleTimestamper(timing)
        self._bursts = self._reads = 0
        self._most_at_once = BURST_NS / timing.period_ns
