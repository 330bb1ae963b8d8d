"""MCAP logs of ROS 1 and ROS 2, record by record, without their index.

What is cut or damaged ends the reading there; what came before is sound by its
checksums. Form: the MCAP specification, https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from acquisition.files import open_regular
from analysis.logs.log_file import (
    MOST_TOPICS,
    LogMessage,
    LogTopic,
    OneFile,
    Serialization,
    checked_definition,
    checked_name,
    damaged,
    short_type,
)
from analysis.logs.unpacking import LARGEST_PART, UnpackError, unpacked

MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _METADATA, _DATA_END = 3, 4, 5, 6, 12, 15
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_SERIALIZATIONS: dict[str, Serialization] = {"cdr": "cdr", "ros1": "ros1"}
_ENCODINGS = ("ros2msg", "ros1msg")


class McapLog(OneFile):
    """Implements `analysis.logs.log_file.LogFile`."""

    format = "MCAP"

    def __init__(self, path: Path) -> None:
        """Look at the file once for its topics.

        Raises:
            SettingsError: a name or a definition is too long, or there are too many.
        """
        super().__init__(path)
        for _ in self._records(is_whole=False):
            pass

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Give every message of `topics`, in the order of the file."""
        self.losses.clear()
        wanted = set(topics)
        for message in self._records(is_whole=True):
            if message.topic in wanted:
                yield message

    def _records(self, *, is_whole: bool) -> Iterator[LogMessage]:
        """Read the file; give messages where the whole of it is wanted."""
        reader = _Records(self, is_whole=is_whole)
        with open_regular(self.path, is_link_followed=True) as file:
            file.read(len(MAGIC))
            yield from reader.of_file(file)


class _Records:
    """The records of one pass through the file."""

    def __init__(self, log: McapLog, *, is_whole: bool) -> None:
        self._log, self._is_whole = log, is_whole
        self._schemas: dict[int, tuple[str, str]] = {}  # type, definition
        self._channels: dict[int, str] = {}

    def of_file(self, file: BinaryIO) -> Iterator[LogMessage]:
        offset = len(MAGIC)
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            opcode, length = _HEAD.unpack(head)
            if opcode == _DATA_END:
                return
            if length > LARGEST_PART:
                self._lose(offset, f"a record of {length} bytes")
                return
            body = file.read(length)
            if len(body) < length:
                self._lose(offset, "the file is cut there")
                return
            try:
                if opcode == _CHUNK:
                    yield from self._of_chunk(body)
                elif (message := self._of_record(opcode, memoryview(body))) is not None:
                    yield message
            except (UnpackError, struct.error, IndexError) as error:
                self._lose(offset, str(error))
                return
            offset += _HEAD.size + length
        self._lose(offset, "the file ends without its end mark")

    def _lose(self, offset: int, why: str) -> None:
        self._log.losses[:] = [f"nothing is read behind byte {offset}: {why}"]

    def _of_chunk(self, body: bytes) -> Iterator[LogMessage]:
        """Give the messages of a chunk whose checksum is right."""
        _, _, size, crc = _CHUNK_HEAD.unpack_from(body)
        name, at = _text(memoryview(body), _CHUNK_HEAD.size)
        (stored,) = struct.unpack_from("<Q", body, at)
        packed = body[at + 8 : at + 8 + stored]
        if len(packed) < stored:
            raise UnpackError("a chunk is cut")
        records = unpacked(packed, name, size)
        if crc and zlib.crc32(records) != crc:
            raise UnpackError("the checksum of a chunk is wrong")
        view, at = memoryview(records), 0
        while at < len(view):
            opcode, length = _HEAD.unpack_from(view, at)
            at += _HEAD.size
            if length > len(view) - at:
                raise UnpackError("a record leads out of its chunk")
            message = self._of_record(opcode, view[at : at + length])
            if message is not None:
                yield message
            at += length

    def _of_record(self, opcode: int, body: memoryview) -> LogMessage | None:
        if opcode == _MESSAGE and self._is_whole:
            channel, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(body)
            topic = self._channels.get(channel)
            if topic is not None:
                return LogMessage(topic, log_ns, bytes(body[_MESSAGE_HEAD.size :]))
        elif opcode == _SCHEMA:
            self._take_schema(body)
        elif opcode == _CHANNEL:
            self._take_channel(body)
        elif opcode == _METADATA:
            self._take_metadata(body)
        return None

    def _take_metadata(self, body: memoryview) -> None:
        """Take from a record of metadata whether the devices were simulated."""
        _, at = _text(body, 0)
        (size,) = struct.unpack_from("<I", body, at)
        at, end = at + 4, at + 4 + size
        while at < end:
            key, at = _text(body, at)
            value, at = _text(body, at)
            if (key, value) == ("simulated", "true"):
                self._log.is_simulated = True

    def _take_schema(self, body: memoryview) -> None:
        (number,) = struct.unpack_from("<H", body)
        name, at = _text(body, 2)
        encoding, at = _text(body, at)
        (size,) = struct.unpack_from("<I", body, at)
        path = self._log.path
        text = bytes(body[at + 4 : at + 4 + size])
        definition = text if encoding in _ENCODINGS else b""
        if len(self._schemas) >= MOST_TOPICS:
            raise damaged(path, f"over {MOST_TOPICS} types")
        self._schemas[number] = (
            short_type(checked_name(path, name, "the name of a type")),
            checked_definition(path, definition, name),
        )

    def _take_channel(self, body: memoryview) -> None:
        number, schema = struct.unpack_from("<HH", body)
        topic, at = _text(body, 4)
        encoding, _ = _text(body, at)
        path = self._log.path
        topic = checked_name(path, topic, "the name of a topic")
        type_name, definition = self._schemas.get(schema, ("", ""))
        serialization = _SERIALIZATIONS.get(encoding)
        if serialization is None:
            self._log.unread[topic] = f"{type_name or 'no type'}, {encoding[:40]}"
        if len(self._log.topics) + len(self._log.unread) > MOST_TOPICS:
            raise damaged(path, f"over {MOST_TOPICS} topics")
        if serialization is None:
            return
        self._channels[number] = topic
        self._log.topics[topic] = LogTopic(topic, type_name, serialization, definition)


def _text(body: memoryview, at: int) -> tuple[str, int]:
    """Return a text with its length before it, and where it ends."""
    (size,) = struct.unpack_from("<I", body, at)
    end = at + 4 + size
    if end > len(body):
        raise UnpackError("a text leads out of its record")
    return bytes(body[at + 4 : end]).decode(errors="replace"), end
