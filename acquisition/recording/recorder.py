"""Recorder: drains the shared memory to a trial file every 20 ms."""

import contextlib
import json
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

import numpy as np

from acquisition.clock import RATE_HZ, Clock
from acquisition.errors import TrialFileError
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.sample import Record
from acquisition.trial_file.data_files import claimed_folder
from acquisition.trial_file.header import TrialHeader
from acquisition.trial_file.verify import VerifiedFile, verify_file
from acquisition.trial_file.writer import (
    FLIGHT_TOPICS,
    TRIAL_TOPICS,
    TrialWriter,
    publish,
)

FLUSH_NS = 250_000_000
_BATCH_NS = 20_000_000  # time span of the samples or frames in one message
PRE_ROLL = 1.0  # recorded time before the trigger [s]


class TrialRecording(Protocol):
    """Interface of a recorder, in this process or another."""

    @property
    def is_recording(self) -> bool:
        """Whether a trial file is open."""
        ...

    @property
    def largest_backlog(self) -> int:
        """Largest number of unwritten cycles since the trial began."""
        ...

    def start(self, path: Path, header: TrialHeader) -> None:
        """Begin a file with the last second of samples.

        Raises:
            TrialFileError: the file exists or cannot be written.
        """
        ...

    def event(self, level: int, name: str, text: str) -> None:
        """Write an event with the present time, if a file is open."""
        ...

    def finish(self, stop_reason: str) -> VerifiedFile:
        """End, verify and publish the file.

        Raises:
            TrialFileError: writing or verification failed; the file keeps `.partial`.
        """
        ...

    def abandon(self) -> None:
        """Stop recording; the data so far are kept as `.partial`."""
        ...


class Recorder:
    """Writes one trial at a time from the shared memory; implements `TrialRecording`.

    `drain` is called every 20 ms or so.

    Attributes:
        failure: error of the last file, or None.
        largest_backlog: largest number of unwritten cycles since the trial began.
    """

    def __init__(self, shared: SharedLayout, clock: Clock) -> None:
        self._shared = shared
        self._clock = clock
        self._cycles = shared.cycles.reader()
        self._wrenches = shared.wrenches.reader()
        self._frames = shared.frames.reader()
        self._writer: TrialWriter | None = None
        self._has_frames = False
        self._flushed_ns = 0
        self._claim = ExitStack()
        self.largest_backlog = 0
        self.failure: TrialFileError | None = None

    @property
    def is_recording(self) -> bool:
        """Whether a trial file is open."""
        return self._writer is not None

    def start(self, path: Path, header: TrialHeader) -> None:
        """Begin a file with the last second of samples."""
        if self._writer is not None:
            raise TrialFileError(path, "another trial is being recorded")
        self._has_frames = header.has_frames
        topics = FLIGHT_TOPICS if self._has_frames else TRIAL_TOPICS
        with ExitStack() as stack:
            stack.enter_context(claimed_folder(path.parent))
            writer = TrialWriter(path, header, topics)
            self._claim = stack.pop_all()
        now_ns = self._clock.now_ns()
        earliest_ns = now_ns - int(PRE_ROLL * 1e9)
        for reader in (self._cycles, self._wrenches, self._frames):
            reader.read()
            reader.lost = 0
        self._cycles.rewind(int(PRE_ROLL * RATE_HZ))
        self._wrenches.rewind(
            _count_since(self._shared.wrenches.last(8192), earliest_ns)
        )
        self._frames.rewind(_count_since(self._shared.frames.last(8192), earliest_ns))
        self.largest_backlog = 0
        self._flushed_ns = now_ns
        self.failure = None
        self._writer = writer

    def drain(self) -> None:
        """Write new data, flush every 0.25 s, and send a heartbeat.

        After an error the file is left as `.partial`; see `failure`.
        """
        if self._writer is not None:
            try:
                self._write_new(self._writer)
            except TrialFileError as error:
                self.failure = error
                self._close_partial()
        self._shared.heartbeats.beat(ProcessRole.RECORDER, self._clock.now_ns())

    def event(self, level: int, name: str, text: str) -> None:
        """Write an event with the present time, if a file is open."""
        if self._writer is None:
            return
        try:
            self._writer.write_event(self._clock.now_ns(), level, name, text)
        except TrialFileError as error:
            self.failure = error
            self._close_partial()

    def finish(self, stop_reason: str) -> VerifiedFile:
        """End, verify and publish the file; see `seal`."""
        writer = self._writer
        if writer is None:
            if self.failure is not None:
                raise self.failure
            raise RuntimeError("no trial is being recorded")
        self._writer = None
        with self._claim:
            self._write_new(writer)
            return seal(writer, stop_reason)

    def abandon(self) -> None:
        """Stop recording; the data so far are kept as `.partial`."""
        writer = self._writer
        if writer is not None:
            with contextlib.suppress(TrialFileError):
                self._write_new(writer)
                writer.flush()
            self._close_partial()

    def _close_partial(self) -> None:
        """Close the file as `.partial`."""
        if self._writer is not None:
            self._writer.close_partial()
            self._writer = None
            self._claim.close()

    def publish_state(self) -> None:
        """Publish the recorder's status in the shared memory."""
        failure = self.failure
        state = {
            "is_recording": self.is_recording,
            "largest_backlog": self.largest_backlog,
            "lost": self._cycles.lost,
            "failure": [str(failure.path), failure.reason, failure.hint]
            if failure
            else None,
        }
        self._shared.recorder.write(json.dumps(state).encode())

    def _write_new(self, writer: TrialWriter) -> None:
        self.largest_backlog = max(self.largest_backlog, self._cycles.backlog)
        writer.write_cycles(self._cycles.read())
        for batch in _batches(self._wrenches.read()):
            writer.write_wrenches(batch)
        if self._has_frames:
            for batch in _batches(self._frames.read()):
                writer.write_can(batch)
        writer.counts.lost_in_ring = self._cycles.lost
        if self._clock.now_ns() - self._flushed_ns >= FLUSH_NS:
            writer.flush()
            self._flushed_ns = self._clock.now_ns()


def seal(writer: TrialWriter, stop_reason: str) -> VerifiedFile:
    """End a file, verify it, and give it its final name.

    Raises:
        TrialFileError: writing or verification failed; the file keeps `.partial`.
    """
    try:
        writer.finish(stop_reason)
        verified = verify_file(writer.partial, writer.counts)
        publish(writer)
    except TrialFileError:
        writer.close_partial()
        raise
    return verified


def _count_since(records: Record, earliest_ns: int) -> int:
    """Return the number of `records` at or after `earliest_ns`."""
    return int(np.count_nonzero(records["t_ns"].astype(np.int64) >= earliest_ns))


def _batches(records: Record) -> list[Record]:
    """Split records, oldest first, into batches of about 20 ms."""
    if not len(records):
        return []
    span_ns = int(records["t_ns"][-1]) - int(records["t_ns"][0])
    return np.array_split(records, max(1, round(span_ns / _BATCH_NS)))
