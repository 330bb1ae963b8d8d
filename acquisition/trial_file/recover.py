"""Recovery of damaged trial files: sound records are copied to a new file."""

import hashlib
import json
import os
import struct
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer
from pydantic import TypeAdapter

from acquisition.clock import NS_PER_S, PERIOD_NS
from acquisition.errors import TrialFileError
from acquisition.files import publish_file
from acquisition.sample import Flag
from acquisition.schema import CYCLE
from acquisition.temporary_folders import temporary_folder
from acquisition.trial_file.contents import (
    as_trial_file_error,
    read_contents,
    read_file,
)
from acquisition.trial_file.header import attachment_digests
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.salvage import Gap, Salvaged, SoundRecords
from acquisition.trial_file.verify import VerifiedFile, verify_file
from acquisition.trial_file.writer import CHUNK_BYTES

_MOST_NEIGHBOURS = 50  # neighbouring files searched for an attachment
_LONGEST_MISSED = 50_000_000  # ns; a longer gap is a loss, not missed cycles
_SECTION = "has data whose checksum is wrong"  # reason if all records seem sound
ROOM = ".recover"  # prefix of the temporary folder of a copy


@dataclass(frozen=True, slots=True)
class LostSpan:
    """A lost part of a recording.

    Attributes:
        start: start relative to the first cycle [s].
        seconds: duration [s].
    """

    start: float
    seconds: float


_LOSSES = TypeAdapter(tuple[LostSpan, ...])


class TrialCopy:
    """A trial file written from salvaged records.

    Attributes:
        messages: number of messages so far.
        metadata: names of the metadata records so far.
        details: contents of the metadata record `recovered`.
    """

    def __init__(self, file: IO[bytes], details: Mapping[str, str]) -> None:
        self.messages = 0
        self.metadata: set[str] = set()
        self.details = dict(details)
        self._writer = Writer(
            file,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )
        self._writer.start(profile="ros2", library="traction")
        self._schemas = {0: 0}  # number in the source -> number here
        self._channels: dict[int, int] = {}
        self._cycle_channel: int | None = None
        self._numbers: list[int] = []
        self._times: list[int] = []
        self._late = 0
        self._gaps: dict[int, list[Gap]] = {}  # by number of cycles before the gap
        self._digests: dict[str, str] = {}
        self._attached: set[str] = set()
        self._stop_reason = "recovered"

    def add(self, record: Salvaged) -> None:
        """Append a record, in the order of the source.

        Raises:
            OSError: the disk is full or unavailable.
        """
        match record:
            case Message():
                self._add_message(record)
            case Schema() if record.id not in self._schemas:
                self._schemas[record.id] = self._writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in self._channels:
                self._add_channel(record)
            case Metadata():
                self._add_metadata(record)
            case Attachment() if record.name not in self._attached:
                self._add_attachment(record)
            case Gap():
                self._gaps.setdefault(len(self._numbers), []).append(record)
            case _:
                pass  # a repeated schema or channel

    def finish(self, salvage: SoundRecords) -> None:
        """Write the metadata of the recovery and the summary.

        Raises:
            OSError: the disk is full or unavailable.
        """
        is_elsewhere = not salvage.reason and self.details["reason"] == _SECTION
        self.details["is_doubtful"] = "true" if is_elsewhere else "false"
        self.details["reason"] = salvage.reason or self.details["reason"]
        self.details["messages_kept"] = str(self.messages)
        self.details["bytes_dropped"] = str(salvage.lost_bytes)
        self.details["attachments_dropped"] = " ".join(self.missing_attachments)
        self.details["gaps"] = json.dumps([asdict(loss) for loss in self.losses])
        missed = int((np.diff(np.array(self._numbers, np.int64)) - 1).sum())
        result = {
            "complete": "false",
            "stop_reason": self._stop_reason,
            "cycles_expected": str(len(self._numbers) + missed),
            "cycles_written": str(len(self._numbers)),
            "cycles_missed": str(missed),
            "late_cycles": str(self._late),
        }
        self._writer.flush()
        self._writer.add_metadata("recovered", self.details)
        self._writer.add_metadata("result", result)
        self._writer.finish()

    @property
    def missing_attachments(self) -> dict[str, str]:
        """Digests of the original attachments missing in the copy, by name."""
        return {
            name: digest
            for name, digest in self._digests.items()
            if name not in self._attached
        }

    @property
    def losses(self) -> list[LostSpan]:
        """Lost parts of the recording, in order."""
        if not self._times:
            return []
        first = self._edges(0)[0] + PERIOD_NS if 0 in self._gaps else self._times[0]
        # A lost chunk may show only as a gap between cycles.
        steps = np.diff(np.array(self._times))
        holes = (np.flatnonzero(steps > _LONGEST_MISSED) + 1).tolist()
        spans: list[LostSpan] = []
        for at in sorted({*self._gaps, *holes}):
            before, after = self._edges(at)
            lost_ns = after - before - PERIOD_NS
            if lost_ns > PERIOD_NS:  # more than one missed cycle
                start_s = max(0, before + PERIOD_NS - first) / NS_PER_S
                spans.append(LostSpan(round(start_s, 3), round(lost_ns / NS_PER_S, 3)))
        return spans

    def _edges(self, at: int) -> tuple[int, int]:
        """Return the log times of the cycles before and after a gap [ns].

        At the ends of the recording they are taken from the headers of lost chunks; a
        gap of unknown length has length 0.

        Args:
            at: number of cycles before the gap.
        """
        stated = [
            (gap.first_ns, gap.last_ns)
            for gap in self._gaps.get(at, [])
            if gap.first_ns
        ]
        before = self._times[at - 1] if at else None
        behind = self._times[at] if at < len(self._times) else None
        if before is None:
            earliest = min((first for first, _ in stated), default=behind)
            before = (earliest or 0) - PERIOD_NS
        if behind is None:
            behind = max((last for _, last in stated), default=before) + PERIOD_NS
        return before, behind

    def _add_metadata(self, record: Metadata) -> None:
        """Append a metadata record, except the two that `finish` writes."""
        if record.name == "result":
            self._stop_reason = record.metadata.get("stop_reason", "recovered")
        elif record.name != "recovered" and record.name not in self.metadata:
            self.metadata.add(record.name)
            if record.name == "provenance":
                self._digests = attachment_digests(record.metadata)
            self._writer.flush()  # keeps the order: messages are buffered
            self._writer.add_metadata(record.name, record.metadata)

    def _add_attachment(self, record: Attachment) -> None:
        self._attached.add(record.name)
        self._writer.flush()
        self._writer.add_attachment(
            record.create_time,
            record.log_time,
            record.name,
            record.media_type,
            record.data,
        )

    def _add_channel(self, record: Channel) -> None:
        self._channels[record.id] = self._writer.register_channel(
            record.topic,
            record.message_encoding,
            self._schemas[record.schema_id],
            record.metadata,
        )
        if record.topic == "/cycle":
            self._cycle_channel = record.id

    def _add_message(self, record: Message) -> None:
        channel = self._channels[record.channel_id]
        self._writer.add_message(
            channel, record.log_time, record.data, record.publish_time, record.sequence
        )
        self.messages += 1
        is_cycle = record.channel_id == self._cycle_channel
        if is_cycle and len(record.data) == CYCLE.size:  # others fail to verify
            cycle = np.frombuffer(record.data, CYCLE.dtype, 1)[0]
            self._numbers.append(int(cycle["cycle"]))
            self._times.append(record.log_time)
            self._late += bool(cycle["flags"] & Flag.DEADLINE_MISSED)


@dataclass(frozen=True, slots=True)
class Recovery:
    """Result of a recovery.

    Attributes:
        source: damaged file, unchanged.
        path: new file; the source itself if it is not damaged.
        verified: result of verifying `path`.
        messages: number of messages in `path`.
        bytes_dropped: damaged bytes of the source.
        losses: lost parts of the recording, as far as known.
        missing_attachments: names of attachments missing in `path`, and in all files
            next to a damaged source.
        reason: first damage of the source; "" if none.
        is_doubtful: the damage is in a part without its own checksum: metadata or an
            index.
        is_new: the file was written by this call.
    """

    source: Path
    path: Path
    verified: VerifiedFile
    messages: int
    bytes_dropped: int = 0
    losses: tuple[LostSpan, ...] = ()
    missing_attachments: tuple[str, ...] = ()
    reason: str = ""
    is_doubtful: bool = False
    is_new: bool = False

    @property
    def seconds_dropped(self) -> float:
        """Duration of the lost parts, as far as known [s]."""
        return sum(loss.seconds for loss in self.losses)


def recovered_path(source: Path) -> Path:
    """Return the path of the recovered trial, e.g. T07.recovered.mcap."""
    stem = source.name.removesuffix(".partial").removesuffix(".mcap")
    return source.with_name(f"{stem}.recovered.mcap")


def recover_file(source: Path) -> Recovery:
    """Copy every sound record of `source` to a new file.

    A damaged attachment is replaced by the identical one (by digest) of a neighbouring
    file, if any. The new file is marked as incomplete, verified and read-only. Nothing
    is written for an undamaged source or one recovered before.

    Raises:
        TrialFileError: nothing can be saved, or another file has the target's name.
    """
    data = read_file(source)
    try:
        verified = verify_file(source)
    except TrialFileError as error:
        reason = error.reason
    else:
        return _undamaged(source, verified)
    target = recovered_path(source)
    details = {
        "source": os.fsencode(source.name).decode(errors="replace"),
        "source_sha256": hashlib.sha256(data).hexdigest(),
        "source_bytes": str(len(data)),
        "reason": reason,
    }
    if target.exists():
        return _earlier_recovery(source, target, details)
    try:
        with temporary_folder(ROOM, source.parent) as room:
            return _recover(data, source, details, room / target.name)
    except OSError as error:
        raise TrialFileError(
            target,
            f"cannot be written ({error.strerror})",
            hint="The source is untouched.",
        ) from error


def _recover(
    data: bytes, source: Path, details: Mapping[str, str], written: Path
) -> Recovery:
    salvage = SoundRecords(data, source)
    copy = _write(salvage, source, details, written)
    try:
        verified = verify_file(written)
    except TrialFileError as error:
        raise TrialFileError(source, f"makes no trial: {error.reason}") from error
    target = recovered_path(source)
    publish_file(written, target)
    return Recovery(
        source=source,
        path=target,
        verified=verified,
        messages=copy.messages,
        bytes_dropped=int(copy.details["bytes_dropped"]),
        losses=tuple(copy.losses),
        missing_attachments=tuple(copy.missing_attachments),
        reason=copy.details["reason"],
        is_doubtful=copy.details["is_doubtful"] == "true",
        is_new=True,
    )


def _write(
    salvage: SoundRecords, source: Path, details: Mapping[str, str], written: Path
) -> TrialCopy:
    """Write the salvaged records to the file `written` and synchronise it."""
    with written.open("xb") as file:
        copy = TrialCopy(file, details)
        try:
            for record in salvage:
                copy.add(record)
        except (struct.error, ValueError, OverflowError, MemoryError) as error:
            raise TrialFileError(source, f"cannot be copied ({error})") from error
        if not copy.messages or "trial" not in copy.metadata:
            why = salvage.reason or details["reason"]
            if copy.messages and salvage.reason:
                why += "; what says which trial it is was there"
            raise TrialFileError(source, f"has nothing to save: it {why}")
        for name, digest in copy.missing_attachments.items():
            content = _neighbouring_attachment(source, name, digest)
            if content is not None:
                copy.add(Attachment(0, 0, name, "text/plain", content))
        copy.finish(salvage)
        file.flush()
        os.fsync(file.fileno())
    return copy


def _neighbouring_attachment(source: Path, name: str, digest: str) -> bytes | None:
    """Return the attachment with this digest from a neighbouring file, or None."""
    for path in sorted(source.parent.glob("*.mcap"))[:_MOST_NEIGHBOURS]:
        try:
            content = read_contents(path).attachments.get(name)
        except TrialFileError:
            continue
        if content is not None and hashlib.sha256(content).hexdigest() == digest:
            return content
    return None


def _earlier_recovery(
    source: Path, target: Path, details: Mapping[str, str]
) -> Recovery:
    """Return the result of an earlier recovery of the same file."""
    earlier = TrialReader(target).metadata.get("recovered", {})
    if earlier.get("source_sha256") != details["source_sha256"]:
        raise TrialFileError(
            target,
            f"exists already and was not made from {source.name} as it is now",
            hint="Move it away to recover again; nothing is ever overwritten.",
        )
    with as_trial_file_error(target):
        messages = int(earlier.get("messages_kept", ""))
        dropped = int(earlier.get("bytes_dropped", ""))
        losses = _LOSSES.validate_json(earlier.get("gaps", "[]"))
    return Recovery(
        source=source,
        path=target,
        verified=verify_file(target),
        messages=messages,
        bytes_dropped=dropped,
        losses=losses,
        missing_attachments=tuple(earlier.get("attachments_dropped", "").split()),
        reason=earlier.get("reason", details["reason"]),
        is_doubtful=earlier.get("is_doubtful") == "true",
    )


def _undamaged(source: Path, verified: VerifiedFile) -> Recovery:
    """Return the result for an undamaged or already recovered file."""
    reader = TrialReader(source)
    written = attachment_digests(reader.metadata["provenance"])
    return Recovery(
        source=source,
        path=source,
        verified=verified,
        messages=sum(reader.topic_counts().values()),
        missing_attachments=tuple(n for n in written if n not in reader.attachments),
    )
