"""ROS 1 bags, read sequentially without the index, so that truncated bags work, too.

Format: ROS bag 2.0, https://wiki.ros.org/Bags/Format/2.0. A record has a header of
fields `name=value` and data; chunks hold connections and messages.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from acquisition.files import open_regular
from acquisition.trial_file.unpacking import DamageError
from analysis.logs.log_file import (
    LARGEST_PART,
    MOST_TOPICS,
    LogMessage,
    LogTopic,
    OneFile,
    checked_name,
    damaged,
    short_type,
)

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_SIZE = struct.Struct("<I")
_NS = 1_000_000_000
_Header = dict[bytes, bytes]


class BagLog(OneFile):
    """ROS 1 bag; implements `analysis.logs.log_file.LogFile`."""

    format = "ROS 1 bag"

    def __init__(self, path: Path, file: Path) -> None:
        """Scan the file once for its topics.

        Raises:
            SettingsError: a name is too long, or there are too many topics.
        """
        super().__init__(path, file)
        self._connections: dict[int, str] = {}
        for _ in self._records(set()):
            pass

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Yield every message of `topics` in file order."""
        self.losses.clear()
        yield from self._records(set(topics))

    def _records(self, wanted: set[str]) -> Iterator[LogMessage]:
        with open_regular(self.file, is_link_followed=True) as file:
            file.read(len(MAGIC))
            offset = len(MAGIC)
            while True:
                try:
                    record = _record_of_file(file)
                    if record is None:
                        return
                    header, data = record
                    if header.get(b"op") == bytes([_CHUNK]):
                        yield from self._of_chunk(header, data, wanted)
                    else:
                        yield from self._of_record(header, data, wanted)
                except (DamageError, struct.error, KeyError, IndexError) as error:
                    why = str(error) or "a record is damaged"
                    self.losses[:] = [f"nothing is read after byte {offset}: {why}"]
                    return
                offset = file.tell()

    def _of_chunk(
        self, header: _Header, data: bytes, wanted: set[str]
    ) -> Iterator[LogMessage]:
        name = header[b"compression"].decode(errors="replace")
        (size,) = _SIZE.unpack(header[b"size"])
        records, at = self.unpacker.unpack(data, name, size), 0
        while at < len(records):
            inner, data, at = _record_at(records, at)
            yield from self._of_record(inner, data, wanted)

    def _of_record(
        self, header: _Header, data: bytes, wanted: set[str]
    ) -> Iterator[LogMessage]:
        op = header[b"op"][0]
        if op == _CONNECTION:
            self._take_connection(header, data)
        elif op == _MESSAGE:
            (number,) = _SIZE.unpack(header[b"conn"])
            topic = self._connections.get(number)
            if topic in wanted:
                seconds, rest = struct.unpack("<II", header[b"time"])
                yield LogMessage(topic, seconds * _NS + rest, data)

    def _take_connection(self, header: _Header, data: bytes) -> None:
        (number,) = _SIZE.unpack(header[b"conn"])
        fields = _fields(data)
        topic = checked_name(self.path, header[b"topic"], "the name of a topic")
        kind = checked_name(self.path, fields[b"type"], "the name of a type")
        if len(self._connections) >= MOST_TOPICS:
            raise damaged(self.path, f"over {MOST_TOPICS} topics")
        self._connections[number] = topic
        self.topics[topic] = LogTopic(topic, short_type(kind), "ros1")


def _record_of_file(file: BinaryIO) -> tuple[_Header, bytes] | None:
    """Return header and data of the next record; None at the end of the file."""
    head = file.read(_SIZE.size)
    if not head:
        return None
    header = _fields(_part(file, head))
    return header, _part(file, file.read(_SIZE.size))


def _part(file: BinaryIO, head: bytes) -> bytes:
    (size,) = _SIZE.unpack(head)
    if size > LARGEST_PART:
        raise DamageError(f"a record of {size} bytes")
    data = file.read(size)
    if len(data) < size:
        raise DamageError("the file is cut there")
    return data


def _record_at(records: bytes, at: int) -> tuple[_Header, bytes, int]:
    """Return header and data of a record in a chunk, and the offset of the next one."""
    parts: list[bytes] = []
    for _ in range(2):
        (size,) = _SIZE.unpack_from(records, at)
        at += _SIZE.size
        if size > len(records) - at:
            raise DamageError("a record exceeds its chunk")
        parts.append(records[at : at + size])
        at += size
    return _fields(parts[0]), parts[1], at


def _fields(header: bytes) -> _Header:
    """Parse the fields of a header by name."""
    fields: _Header = {}
    at = 0
    while at < len(header):
        (size,) = _SIZE.unpack_from(header, at)
        at += _SIZE.size
        if size > len(header) - at:
            raise DamageError("a field exceeds its header")
        name, mark, value = header[at : at + size].partition(b"=")
        if not mark:
            raise DamageError("a header has an invalid field")
        fields[name] = value
        at += size
    return fields
