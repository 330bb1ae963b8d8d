"""The recorder: drains the ring into a trial file, every few cycles."""

from collections.abc import Callable

from acquisition.clock import Clock
from acquisition.devices import WrenchSample
from acquisition.errors import TrialFileError
from acquisition.shared import SampleRing
from acquisition.trial_file.verify import Verified, verify
from acquisition.trial_file.writer import TrialWriter, publish

FLUSH_NS = 250_000_000
RATE_HZ = 500
PRE_ROLL = 1.0  # what is kept from before the trigger [s]


class Recorder:
    """Writes one trial at a time from a ring of samples.

    `start` opens a writer and goes back by the pre-roll; `drain` is called every
    20 ms or so; `stop` ends, verifies and publishes the file.
    """

    def __init__(self, ring: SampleRing, clock: Clock) -> None:
        self._clock = clock
        self._reader = ring.reader()
        self._writer: TrialWriter | None = None
        self._wrenches: list[WrenchSample] = []
        self._flushed_ns = 0
        self.lost = 0

    @property
    def is_recording(self) -> bool:
        """Whether a trial file is open."""
        return self._writer is not None

    def add_wrenches(self, samples: list[WrenchSample]) -> None:
        """Take the sensor's samples; kept for the pre-roll until they are written."""
        self._wrenches += samples
        if self._writer is None:
            excess = len(self._wrenches) - int(PRE_ROLL * 2000)
            if excess > 0:
                del self._wrenches[:excess]

    def start(self, open_writer: Callable[[], TrialWriter]) -> None:
        """Begin a file with the last second of samples."""
        self._reader.read()
        self._reader.lost = 0
        self._reader.rewind(int(PRE_ROLL * RATE_HZ))
        self._writer = open_writer()
        self._flushed_ns = self._clock.now_ns()
        earliest = self._flushed_ns - int(PRE_ROLL * 1e9)
        self._wrenches = [s for s in self._wrenches if s.t_ns >= earliest]

    def drain(self) -> None:
        """Write what is new; force it to the disk every 0.25 s."""
        if self._writer is None:
            return
        self._writer.write_cycles(self._reader.read())
        self._writer.write_wrench_samples(self._wrenches)
        self._wrenches = []
        self._writer.counts.lost_in_ring = self._reader.lost
        if self._clock.now_ns() - self._flushed_ns >= FLUSH_NS:
            self._writer.flush()
            self._flushed_ns = self._clock.now_ns()

    def event(self, level: int, name: str, text: str) -> None:
        """Write an event of now into the file, if one is open."""
        if self._writer is not None:
            self._writer.write_event(self._clock.now_ns(), level, name, text)

    def detach(self) -> TrialWriter:
        """Write the last samples and give the writer away, to be sealed elsewhere.

        Raises:
            TrialFileError: they could not be written; the file stays as `.partial`.
        """
        writer = self._writer
        if writer is None:
            raise RuntimeError("no trial is being recorded")
        try:
            self.drain()
        finally:
            self._writer = None
        return writer

    def stop(self, stop_reason: str) -> Verified:
        """End, verify and publish the file; see `seal`."""
        return seal(self.detach(), stop_reason)

    def abandon(self) -> None:
        """Let go of a file that can no longer be written; it stays as `.partial`."""
        if self._writer is not None:
            self._writer.close_partial()
            self._writer = None


def seal(writer: TrialWriter, stop_reason: str) -> Verified:
    """End a file, read it back, and give it its final name.

    Raises:
        TrialFileError: it could not be written or verified; it keeps `.partial`.
    """
    try:
        writer.finish(stop_reason)
        verified = verify(writer.partial, writer.counts)
        publish(writer)
    except TrialFileError:
        writer.close_partial()
        raise
    return verified
