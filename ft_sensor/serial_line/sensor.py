"""Driver of a serial wrist sensor of any make."""

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

BURST_NS = 5_000_000  # a read of more than this much of the stream is a burst
BURST_SHARE = 0.1  # share of bursts that shows a buffering adapter


class SerialDevice(Protocol):
    """One make of serial sensor: frames, start-up sequence, status texts.

    Attributes:
        line: serial line.
        timing: timing of the stream.
        ranges: measuring ranges fx fy fz tx ty tz [N, N m].
        stop: command that stops the stream.
    """

    line: PortSettings
    timing: StreamTiming
    ranges: Wrench
    stop: bytes

    def scanner(self) -> FrameScanner[Reading]:
        """Return a scanner for the frames of the stream."""
        ...

    def start(self, dialog: SerialDialog) -> dict[str, str]:
        """Configure the sensor, start its stream, and return its description."""
        ...

    def status_texts(self, status: int) -> tuple[str, ...]:
        """Return the meanings of the set bits of `status`."""
        ...


@dataclass(frozen=True, slots=True)
class SensorCounters:
    """Counters of the stream since it was opened.

    Attributes:
        frames: good frames.
        bad_checks: headers whose frame failed its checks.
        discarded: bytes outside good frames.
        resyncs: losses of synchronisation.
        lost: samples missing by the device's clock or counter.
        jumps: jumps of the device's clock.
        frozen: frames with a frozen wrench or clock.
        bursts: reads of more than 5 ms of the stream.
        reads: reads that were not empty.
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
        """Whether the adapter buffers data before delivery."""
        return self.bursts > BURST_SHARE * self.reads

    def metadata(self) -> dict[str, str]:
        """Return the counters as text for the recording."""
        return {name: str(value) for name, value in asdict(self).items()}


class SerialSensor:
    """A wrist sensor on a serial line.

    Implements `acquisition.devices.WrenchSensor`. Poll it as soon as data arrive: the
    kernel buffers 0.1 s of the stream, and late reads look like bursts.
    """

    def __init__(self, link: SerialLink, clock: Clock, device: SerialDevice) -> None:
        self._link = link
        self._clock = clock
        self.device = device
        self._facts: dict[str, str] = {}
        self._rate = 0.0
        self._begin(device.scanner())

    def open(self) -> None:
        """Configure the sensor, start its stream and measure its rate.

        Raises:
            LinkError: the port failed, or the data are not this sensor's.
            LinkTimeoutError: the sensor is silent or does not answer.
            DeviceFaultError: it refused a setting, its readings are implausible, or its
                rate is below 495 Hz.
        """
        device, scanner = self.device, self.device.scanner()
        dialog = SerialDialog(self._link, self._clock, scanner)
        self._facts = device.start(dialog)
        self._rate = dialog.measure_rate(device.timing, device.line.rate_check)
        scanner.counters = ScanCounters()
        self._begin(scanner)

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return the samples since the last call, oldest first, without blocking.

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
                reading.is_trusted = False
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
        """Counters of the stream since it was opened."""
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
        """Return identity and settings of the sensor, as text."""
        device = self.device
        return {
            **self._facts,
            "port": device.line.port,
            "baudrate": str(device.line.baudrate),
            "ranges": " ".join(f"{limit:g}" for limit in device.ranges),
            "nominal_rate": f"{NS_PER_S / device.timing.period_ns:.1f} Hz",
            "measured_rate": f"{self._rate:.1f} Hz",
        }

    def stream_metadata(self) -> dict[str, str]:
        """Return the counters of the stream, as text."""
        return self.counters.metadata()

    def close(self) -> None:
        """Stop the stream and close the port; never raises."""
        # Errors are expected if the port is gone or closed.
        with contextlib.suppress(TractionError):
            self._link.write(self.device.stop)
        self._link.close()

    def _begin(self, scanner: FrameScanner[Reading]) -> None:
        timing = self.device.timing
        self._scanner = scanner
        self._timestamper = SampleTimestamper(timing)
        self._bursts = self._reads = 0
        self._most_at_once = BURST_NS / timing.period_ns
