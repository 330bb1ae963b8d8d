"""Recovery: what is sound of a broken trial file, as a new file beside it."""

import hashlib
import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from acquisition.errors import TrialFileError
from acquisition.files import publish_file
from acquisition.sample import Flag
from acquisition.schema import CYCLE, EARLIER_CYCLES
from acquisition.temporary_folders import temporary_folder
from acquisition.trial_file.chunks import as_trial_file_error, read_file
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.salvage import Salvaged, SoundRecords
from acquisition.trial_file.verify import VerifiedFile, verify_file
from acquisition.trial_file.writer import CHUNK_BYTES

_CYCLES = {layout.size: layout for layout in (CYCLE, *EARLIER_CYCLES)}
ROOM = ".recover"  # begins the name of a folder in which a copy grows


class TrialCopy:
    """A trial file that grows from salvaged records.

    Attributes:
        messages: how many there are so far.
        metadata: names of the metadata records so far.
        details: what the metadata record `recovered` is going to say.
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
        self._late = 0
        self._stop_reason = "recovered"

    def add(self, record: Salvaged) -> None:
        """Append a record in the order of the source.

        Raises:
            OSError: the disk is full or gone.
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
            case Attachment():
                self._writer.flush()
                self._writer.add_attachment(
                    record.create_time,
                    record.log_time,
                    record.name,
                    record.media_type,
                    record.data,
                )
            case _:
                pass  # a schema or channel that is known already

    def finish(self, salvage: SoundRecords) -> None:
        """Write what was saved and lost, and the summary.

        Raises:
            OSError: the disk is full or gone.
        """
        dropped = int(self.details["source_bytes"]) - salvage.kept_bytes
        self.details["reason"] = salvage.reason or self.details["reason"]
        self.details["messages_kept"] = str(self.messages)
        self.details["bytes_dropped"] = str(dropped if salvage.reason else 0)
        self.details["attachments_dropped"] = " ".join(salvage.left_out)
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

    def _add_metadata(self, record: Metadata) -> None:
        """Append a metadata record; those of `finish` take the place of two."""
        if record.name == "result":
            self._stop_reason = record.metadata.get("stop_reason", "recovered")
        elif record.name != "recovered":
            self.metadata.add(record.name)
            self._writer.flush()  # or it would overtake the messages before it
            self._writer.add_metadata(record.name, record.metadata)

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
        layout = _CYCLES.get(len(record.data)) if is_cycle else None
        if layout is not None:  # others fail to verify
            cycle = np.frombuffer(record.data, layout.dtype, 1)[0]
            self._numbers.append(int(cycle["cycle"]))
            self._late += bool(cycle["flags"] & Flag.DEADLINE_MISSED)


@dataclass(frozen=True, slots=True)
class Recovery:
    """What became of a file that was to be recovered.

    Attributes:
        source: that file, untouched.
        path: the new file; the source itself where it was whole.
        verified: what reading that file back has shown.
        messages: how many it holds.
        bytes_dropped: of the source, from its first broken record on.
        seconds_dropped: recording that was in them, as far as can be seen [s].
        reason: what is broken in the source; empty where it is whole.
        is_new: the file was written now.
    """

    source: Path
    path: Path
    verified: VerifiedFile
    messages: int
    bytes_dropped: int = 0
    seconds_dropped: float = 0.0
    reason: str = ""
    is_new: bool = False


def recovered_path(source: Path) -> Path:
    """Return where the recovered trial goes, e.g. T07.recovered.mcap."""
    stem = source.name.removesuffix(".partial").removesuffix(".mcap")
    return source.with_name(f"{stem}.recovered.mcap")


def recover_file(source: Path) -> Recovery:
    """Save everything up to the first broken record of `source` into a new file.

    The new file is marked as incomplete, verified and read-only. A source that is
    whole needs none, and one that was recovered before is not recovered again.

    Raises:
        TrialFileError: nothing can be saved, or another file stands in the way.
    """
    data = read_file(source)
    try:
        verified = verify_file(source)
    except TrialFileError as error:
        reason = error.reason
    else:
        return Recovery(source, source, verified, _message_count(source))
    target = recovered_path(source)
    details = {
        "source": os.fsencode(source.name).decode(errors="replace"),
        "source_sha256": hashlib.sha256(data).hexdigest(),
        "source_bytes": str(len(data)),
        "reason": reason,
    }
    if target.exists():
        return _earlier(source, target, details)
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
        seconds_dropped=salvage.lost_seconds,
        reason=copy.details["reason"],
        is_new=True,
    )


def _write(
    salvage: SoundRecords, source: Path, details: Mapping[str, str], written: Path
) -> TrialCopy:
    """Write what `salvage` gives into `written`, down to the disk."""
    with written.open("xb") as file:
        copy = TrialCopy(file, details)
        try:
            for record in salvage:
                copy.add(record)
        except (struct.error, ValueError, OverflowError, MemoryError) as error:
            raise TrialFileError(source, f"cannot be copied ({error})") from error
        if not copy.messages or "trial" not in copy.metadata:
            why = salvage.reason or details["reason"]
            raise TrialFileError(source, f"has nothing to save: it {why}")
        copy.finish(salvage)
        file.flush()
        os.fsync(file.fileno())
    return copy


def _earlier(source: Path, target: Path, details: Mapping[str, str]) -> Recovery:
    """Return what an earlier recovery of this very file has given."""
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
    return Recovery(
        source=source,
        path=target,
        verified=verify_file(target),
        messages=messages,
        bytes_dropped=dropped,
        reason=earlier.get("reason", details["reason"]),
    )


def _message_count(path: Path) -> int:
    return sum(TrialReader(path).topic_counts().values())
