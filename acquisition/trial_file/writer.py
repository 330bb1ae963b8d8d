"""TrialWriter: writes cycles, sensor samples and events to an MCAP file."""

import contextlib
import hashlib
import os
from collections.abc import Generator, Mapping
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from acquisition.cdr import CdrWriter, encode_log, encode_string
from acquisition.errors import TrialFileError
from acquisition.files import publish_file, sync_directory
from acquisition.formats import FORMAT
from acquisition.sample import CHANNELS, Flag, Record
from acquisition.schema import CYCLE, TRUTH, Layout, schema_text
from acquisition.trial_file.header import (
    TrialHeader,
    WriterCounts,
    digest_fields,
)
from acquisition.trial_file.views import VIEW_TOPICS, encode_can_batch, encode_views

CHUNK_BYTES = 262_144
NS_PER_S = 1_000_000_000

TRIAL_TOPICS = {
    "/robot_description": "std_msgs/msg/String",
    "/cycle": "traction_msgs/msg/Cycle",
    **VIEW_TOPICS,
    "/events": "rcl_interfaces/msg/Log",
    "/ft/raw": "traction_msgs/msg/WrenchBatch",
}
TRUTH_TOPIC = "/truth"
CAN_TOPIC = "/can/raw"
TRUTH_TOPICS = {TRUTH_TOPIC: "traction_msgs/msg/Truth"}
FLIGHT_TOPICS = {**TRIAL_TOPICS, CAN_TOPIC: "traction_msgs/msg/CanBatch"}


def topics_by_sizes(sizes: Mapping[int, int]) -> Mapping[str, str]:
    """Return the topics of a file in the order of its channel numbers.

    Args:
        sizes: message sizes [bytes] by channel number, from 1 on.

    Returns:
        Types by topic; empty if the sizes fit no file of this program.
    """
    if set(sizes) == {1} and sizes[1] == TRUTH.size:
        return TRUTH_TOPICS
    numbers = {topic: i for i, topic in enumerate(FLIGHT_TOPICS, 1)}
    if sizes.get(numbers["/cycle"], CYCLE.size) != CYCLE.size:
        return {}
    topics = FLIGHT_TOPICS if numbers[CAN_TOPIC] in sizes else TRIAL_TOPICS
    return topics if max(sizes, default=0) <= len(topics) else {}


class TrialWriter:
    """Writes `<name>.mcap.partial`; `publish` renames it to `<name>.mcap`.

    The partial file is created exclusively: an existing one is never changed. Used by
    the recorder only, not by the control loop.

    Raises:
        TrialFileError: the file exists, or cannot be created or written.
    """

    def __init__(
        self,
        path: Path,
        header: TrialHeader,
        topics: Mapping[str, str] = TRIAL_TOPICS,
    ) -> None:
        self.path = path
        self.partial = path.with_name(path.name + ".partial")
        self.counts = WriterCounts()
        self._header = header
        if path.exists():
            raise TrialFileError(path, "exists already and is never overwritten")
        try:
            self._file = self.partial.open("xb")
        except OSError as error:
            raise TrialFileError(self.partial, _reason(error)) from error
        self._writer = Writer(
            self._file,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )
        with self._guarded():
            sync_directory(path.parent)
            self._start(topics)

    def write_cycles(self, records: Record) -> None:
        """Append traction_msgs/Cycle records in order and set their stamps."""
        if not len(records):
            return
        records = records.copy()
        log_times = records["host_ns"].astype(np.int64) + self._header.utc_offset_ns
        records["sec"], records["nanosec"] = np.divmod(log_times, NS_PER_S)
        arm_ns = records["arm_ns"].astype(np.int64)
        published = np.where(arm_ns > 0, arm_ns + self._header.utc_offset_ns, log_times)
        self._count_cycles(records)
        with self._guarded():
            size = CYCLE.size
            every = self._header.views_every
            data = records.tobytes()
            numbers = records["cycle"].tolist()
            rows = zip(numbers, log_times.tolist(), published.tolist(), strict=True)
            for i, (number, log_time, publish_time) in enumerate(rows):
                payload = data[i * size : (i + 1) * size]
                self._add("/cycle", log_time, payload, publish_time, number)
                if every and number % every == 0:
                    for topic, view in encode_views(records[i], log_time).items():
                        self._add(topic, log_time, view, publish_time, number)

    def write_wrenches(self, samples: Record) -> None:
        """Append one batch of sensor samples (records of the ring buffer)."""
        if not len(samples):
            return
        log_time = int(samples["t_ns"][-1]) + self._header.utc_offset_ns
        writer = CdrWriter().header(log_time, "ft_sensor")
        for name in ("t_ns", "counter", "status", "wrench"):
            writer.sequence(np.ascontiguousarray(samples[name]).ravel())
        with self._guarded():
            self._add("/ft/raw", log_time, writer.finish())

    def write_event(self, host_ns: int, level: int, name: str, text: str) -> None:
        """Append an event at monotonic time `host_ns`; levels as in Log."""
        t_ns = host_ns + self._header.utc_offset_ns
        with self._guarded():
            self._add("/events", t_ns, encode_log(t_ns, level, name, text))

    def write_truth(self, records: Record) -> None:
        """Append records of traction_msgs/Truth (truth files only)."""
        self._write_stamped(TRUTH_TOPIC, TRUTH, records)

    def _write_stamped(self, topic: str, layout: Layout, records: Record) -> None:
        """Append records whose `host_ns` gives stamp and log time."""
        records = records.copy()
        log_times = records["host_ns"].astype(np.int64) + self._header.utc_offset_ns
        records["sec"], records["nanosec"] = np.divmod(log_times, NS_PER_S)
        size = layout.size
        data = records.tobytes()
        with self._guarded():
            for i, log_time in enumerate(log_times.tolist()):
                self._add(topic, log_time, data[i * size : (i + 1) * size])

    def write_can(self, frames: Record) -> None:
        """Append raw CAN frames (records of the ring buffer) as one batch."""
        if not len(frames):
            return
        log_time = int(frames["t_ns"][-1]) + self._header.utc_offset_ns
        with self._guarded():
            self._add(CAN_TOPIC, log_time, encode_can_batch(log_time, frames))

    def flush(self) -> None:
        """End the current chunk and synchronise it to the disk."""
        with self._guarded():
            self._writer.flush()
            self._file.flush()
            os.fsync(self._file.fileno())

    def close_partial(self) -> None:
        """Close the file as `.partial`, e.g. after a write error."""
        with contextlib.suppress(OSError):
            self._file.close()

    def finish(self, stop_reason: str) -> None:
        """Write metadata `result` and the summary, and synchronise to the disk.

        The file keeps its `.partial` name until it is verified and published.
        """
        counts = self.counts
        result = {
            "complete": "true",
            "stop_reason": stop_reason,
            "cycles_expected": str(counts.cycles + counts.missed),
            "cycles_written": str(counts.cycles),
            "cycles_missed": str(counts.missed),
            "late_cycles": str(counts.late),
            "lost_in_ring": str(counts.lost_in_ring),
        }
        with self._guarded():
            self._writer.flush()  # keeps `result` after the last messages
            self._writer.add_metadata("result", result)
            self._writer.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()

    def _start(self, topics: Mapping[str, str]) -> None:
        header = self._header
        self._writer.start(profile="ros2", library="traction")
        clock = {
            "utc_offset_ns": str(header.utc_offset_ns),
            "offset_uncertainty_ns": str(header.offset_uncertainty_ns),
            "rate_hz": str(header.rate_hz),
        }
        digests = {
            name: hashlib.sha256(content).hexdigest()
            for name, content in header.attachments.items()
        }
        channels = {c.field: f"{c.unit} in {c.frame}; {c.sign}" for c in CHANNELS}
        metadata: dict[str, dict[str, str]] = {
            "trial": {"format_version": FORMAT, **header.trial},
            "clock": clock,
            "provenance": {**header.provenance, **digest_fields(digests)},
            "channels": channels,
        }
        self._describe(metadata)
        for name, content in header.attachments.items():
            self._writer.add_attachment(0, 0, name, "text/plain", content)
        self._describe(metadata)  # twice, so that a lost disk block spares one
        self._channels: dict[str, int] = {}
        for topic, type_name in topics.items():
            schema = self._writer.register_schema(
                type_name, "ros2msg", schema_text(type_name).encode()
            )
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        self._description_pending = "/robot_description" in topics

    def _describe(self, metadata: Mapping[str, dict[str, str]]) -> None:
        for name, content in metadata.items():
            self._writer.add_metadata(name, content)

    def _count_cycles(self, records: Record) -> None:
        counts = self.counts
        first, last = int(records["cycle"][0]), int(records["cycle"][-1])
        if counts.first_cycle is None:
            counts.first_cycle = first
            counts.last_cycle = first - 1
        assert counts.last_cycle is not None
        counts.missed += last - counts.last_cycle - len(records)
        counts.late += int(np.count_nonzero(records["flags"] & Flag.DEADLINE_MISSED))
        counts.cycles += len(records)
        counts.last_cycle = last

    def _add(
        self,
        topic: str,
        log_time: int,
        data: bytes,
        publish_time: int | None = None,
        sequence: int = 0,
    ) -> None:
        if self._description_pending:
            self._description_pending = False
            description = encode_string(self._header.robot_description)
            self._add("/robot_description", log_time, description)
        self._writer.add_message(
            self._channels[topic],
            log_time,
            data,
            log_time if publish_time is None else publish_time,
            sequence & 0xFFFFFFFF,
        )
        self.counts.messages[topic] = self.counts.messages.get(topic, 0) + 1

    @contextlib.contextmanager
    def _guarded(self) -> Generator[None]:
        try:
            yield
        except (OSError, ValueError) as error:
            self.close_partial()
            raise TrialFileError(
                self.partial,
                _reason(error),
                hint=f"Saved as .partial: traction recover {self.partial}",
            ) from error


def publish(writer: TrialWriter) -> None:
    """Rename a verified `.partial`, read-only; never replaces an existing file."""
    try:
        publish_file(writer.partial, writer.path)
    except OSError as error:
        raise TrialFileError(writer.path, _reason(error)) from error


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"cannot be written ({error.strerror})"
    return f"cannot be written ({error})"
