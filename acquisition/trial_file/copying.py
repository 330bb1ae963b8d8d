"""TrialCopy: salvaged records become an incomplete trial file again."""

from collections.abc import Mapping
from typing import IO

import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from acquisition.sample import Flag
from acquisition.schema import CYCLE
from acquisition.trial_file.salvage import Salvaged, SoundRecords
from acquisition.trial_file.writer import CHUNK_BYTES


class TrialCopy:
    """A trial file that grows from salvaged records.

    Attributes:
        messages: how many there are so far.
        metadata: names of the metadata records so far.
        facts: what the metadata record `recovered` is going to say.
    """

    def __init__(self, file: IO[bytes], facts: Mapping[str, str]) -> None:
        self.messages = 0
        self.metadata: set[str] = set()
        self.facts = dict(facts)
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
                pass  # a schema or channel that was said before

    def finish(self, salvage: SoundRecords) -> None:
        """Write what was saved and lost, and the summary.

        Raises:
            OSError: the disk is full or gone.
        """
        dropped = int(self.facts["source_bytes"]) - salvage.kept_bytes
        self.facts["reason"] = salvage.reason or self.facts["reason"]
        self.facts["messages_kept"] = str(self.messages)
        self.facts["bytes_dropped"] = str(dropped if salvage.reason else 0)
        self.facts["attachments_dropped"] = " ".join(salvage.left_out)
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
        self._writer.add_metadata("recovered", self.facts)
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
        if is_cycle and len(record.data) == CYCLE.size:  # others fail to verify
            cycle = np.frombuffer(record.data, CYCLE.dtype, 1)[0]
            self._numbers.append(int(cycle["cycle"]))
            self._late += bool(cycle["flags"] & Flag.DEADLINE_MISSED)
