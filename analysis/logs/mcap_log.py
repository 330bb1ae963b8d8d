"""MCAP logs of ROS 1 and ROS 2, read sequentially without the index.

Reading ends at a truncated or damaged record; everything before it is verified by
checksums.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from acquisition.files import open_regular
from acquisition.trial_file.records import (
    DAMAGE,
    MAGIC,
    MESSAGE,
    RawRecord,
    parse,
    parse_chunk,
    records_in,
    records_of,
    unpacked,
)
from analysis.logs.log_file import (
    LARGEST_PART,
    MOST_TOPICS,
    LogMessage,
    LogTopic,
    OneFile,
    Serialization,
    checked_name,
    damaged,
    short_type,
)

_MESSAGE = Opcode.MESSAGE.value  # most frequent; a plain integer compares faster
_SERIALIZATIONS: dict[str, Serialization] = {"cdr": "cdr", "ros1": "ros1"}
_SIMULATED = ("simulated", "true")  # metadata entry


class McapLog(OneFile):
    """MCAP log; implements `analysis.logs.log_file.LogFile`."""

    format = "MCAP"

    def __init__(self, path: Path, file: Path) -> None:
        """Scan the file once for its topics.

        Raises:
            SettingsError: a name is too long, or there are too many topics.
        """
        super().__init__(path, file)
        for _ in self.messages(()):
            pass

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Yield every message of `topics` in file order."""
        self.losses.clear()
        wanted, sound_to = set(topics), len(MAGIC)
        definitions = _Definitions(self)
        readable = definitions.topics
        with open_regular(self.file, is_link_followed=True) as file:
            file.read(len(MAGIC))
            try:
                for raw in records_in(file, LARGEST_PART):
                    for opcode, body, _ in self._opened(raw):
                        if opcode != _MESSAGE:
                            definitions.take(opcode, body)
                        elif wanted:
                            channel, _, log_ns, _ = MESSAGE.unpack_from(body)
                            topic = readable.get(channel)
                            if topic in wanted:
                                content = bytes(body[MESSAGE.size :])
                                yield LogMessage(topic, log_ns, content)
                    sound_to = raw.end
            except DAMAGE as error:
                why = str(error) or type(error).__name__
                self.losses[:] = [f"nothing is read after byte {sound_to}: {why}"]

    def _opened(self, raw: RawRecord) -> Iterable[RawRecord]:
        """Unpack a chunk and verify its checksum; other records are passed through."""
        if raw.opcode != Opcode.CHUNK:
            return (raw,)
        chunk = parse_chunk(raw.body, LARGEST_PART)
        return records_of(unpacked(chunk, self.unpacker), what="a chunk")


class _Definitions:
    """Channel definitions collected in one pass through the file.

    Attributes:
        topics: readable topics by channel number.
    """

    def __init__(self, log: McapLog) -> None:
        self.topics: dict[int, str] = {}
        self._log = log
        self._types: dict[int, str] = {}  # by schema number

    def take(self, opcode: int, body: memoryview) -> None:
        if opcode == Opcode.SCHEMA:
            self._take_schema(parse(Schema, body))
        elif opcode == Opcode.CHANNEL:
            self._take_channel(parse(Channel, body))
        elif opcode == Opcode.METADATA:
            with suppress(*DAMAGE):  # not needed to read messages
                metadata = parse(Metadata, body).metadata
                self._log.is_simulated |= _SIMULATED in metadata.items()

    def _take_schema(self, schema: Schema) -> None:
        path = self._log.path
        if len(self._types) >= MOST_TOPICS:
            raise damaged(path, f"over {MOST_TOPICS} types")
        name = checked_name(path, schema.name, "the name of a type")
        self._types[schema.id] = short_type(name)

    def _take_channel(self, channel: Channel) -> None:
        log, topic = self._log, channel.topic
        checked_name(log.path, topic, "the name of a topic")
        type_name = self._types.get(channel.schema_id, "")
        serialization = _SERIALIZATIONS.get(channel.message_encoding)
        if serialization is None:
            encoding = channel.message_encoding[:40]
            log.unread[topic] = f"{type_name or 'no type'}, {encoding}"
        if len(log.topics) + len(log.unread) > MOST_TOPICS:
            raise damaged(log.path, f"over {MOST_TOPICS} topics")
        if serialization is not None:
            self.topics[channel.id] = topic
            log.topics[topic] = LogTopic(topic, type_name, serialization)
