"""An MCAP file being written: records of the mcap library, chunks packed here.

The library's own writer makes an object of every message and writes it field by field,
which takes most of a recorder's time. What it would write is written here as well, byte
by byte: chunks with their message indices, checksums of everything, and a summary.
"""

import struct
import zlib
from collections import defaultdict
from collections.abc import Sequence
from itertools import chain
from typing import IO, Final, Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

_MAGIC: Final = b"\x89MCAP0\r\n"
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS: Final = 22  # bytes of a message before its data
_INDEX: Final = struct.Struct("<BQHI")
_FOOTER: Final = struct.Struct("<BQQQ")  # what its checksum covers
_COMPRESSION: Final = "zstd"


class _Written(Protocol):
    def write(self, stream: RecordBuilder) -> None: ...


class McapFile:
    """Writes schemas, channels, messages, metadata and attachments into a file.

    Messages are collected in chunks, each of which is compressed when it is full. The
    file itself belongs to the caller, who opens, forces and closes it.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, file: IO[bytes], chunk_bytes: int) -> None:
        """Write to `file`; a chunk is full with more than `chunk_bytes` in it."""
        self._file = file
        self._chunk_bytes = chunk_bytes
        self._crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = defaultdict(int)
        self._begin_chunk()

    def start(self, profile: str, library: str) -> None:
        """Write how the file begins."""
        self._write(_MAGIC)
        self._write(_bytes_of(Header(profile, library)))

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Write key-value pairs, before the messages that are still collected."""
        offset = self._file.tell()
        length = self._write(_bytes_of(Metadata(name=name, metadata=data)))
        self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))

    def add_attachment(
        self, create_time: int, log_time: int, name: str, media_type: str, data: bytes
    ) -> None:
        """Write a file into the file, before the messages that are still collected."""
        offset = self._file.tell()
        attachment = Attachment(create_time, log_time, name, media_type, data)
        length = self._write(_bytes_of(attachment))
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=length,
                create_time=create_time,
                log_time=log_time,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema to the chunk; return its number."""
        schema = Schema(
            id=len(self._schemas) + 1, data=data, encoding=encoding, name=name
        )
        self._schemas.append(schema)
        self._collect(_bytes_of(schema))
        return schema.id

    def register_channel(
        self,
        topic: str,
        message_encoding: str,
        schema_id: int,
        metadata: dict[str, str] | None = None,
    ) -> int:
        """Add a channel to the chunk; return its number."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=message_encoding,
            schema_id=schema_id,
            metadata=metadata or {},
        )
        self._channels.append(channel)
        self._collect(_bytes_of(channel))
        return channel.id

    def add_message(
        self,
        channel_id: int,
        log_time: int,
        data: bytes,
        publish_time: int,
        sequence: int = 0,
    ) -> None:
        """Add a message to the chunk, times in UTC [ns]."""
        size = _MESSAGE_FIELDS + len(data)
        head = _MESSAGE.pack(
            Opcode.MESSAGE, size, channel_id, sequence, log_time, publish_time
        )
        index = self._indices[channel_id]
        index.append(log_time)
        index.append(self._collected)
        self._collect(head + data)

    def flush(self) -> None:
        """End the chunk, if there is a message in it, and hand all to the system."""
        self._end_chunk()
        self._file.flush()

    def finish(self) -> None:
        """End the chunk and write the summary and how the file ends."""
        self._end_chunk()
        self._write(_bytes_of(DataEnd(self._crc)))
        start = self._file.tell()
        groups = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary = RecordBuilder()
        offsets: list[SummaryOffset] = []
        for opcode, records in groups:
            begin = summary.count
            _write_all(records, summary)
            length = summary.count - begin
            offsets.append(SummaryOffset(opcode, start + begin, length))
        offset_start = start + summary.count
        _write_all(offsets, summary)
        data = summary.end()
        footer = _FOOTER.pack(Opcode.FOOTER, 8 + 8 + 4, start, offset_start)
        crc = zlib.crc32(footer, zlib.crc32(data))
        self._file.write(data + _bytes_of(Footer(start, offset_start, crc)) + _MAGIC)

    def _begin_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._collected = 0  # bytes
        self._indices: dict[int, list[int]] = defaultdict(list)  # times and offsets

    def _collect(self, record: bytes) -> None:
        self._parts.append(record)
        self._collected += len(record)
        if self._collected > self._chunk_bytes:
            self._end_chunk()

    def _end_chunk(self) -> None:
        if not self._indices:
            return
        data, indices = b"".join(self._parts), self._indices
        times = list(chain.from_iterable(index[::2] for index in indices.values()))
        for channel_id, index in indices.items():
            self._counts[channel_id] += len(index) // 2
        compressed = zstandard.compress(data)
        chunk = Chunk(
            compression=_COMPRESSION,
            data=compressed,
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        start = self._file.tell()
        length = self._write(_bytes_of(chunk))
        index_start = self._file.tell()
        offsets: dict[int, int] = {}
        packed = b""
        for channel_id, index in indices.items():
            offsets[channel_id] = index_start + len(packed)
            packed += _message_index(channel_id, index)
        self._write(packed)
        self._chunks.append(
            ChunkIndex(
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                chunk_start_offset=start,
                chunk_length=length,
                message_index_offsets=offsets,
                message_index_length=len(packed),
                compression=_COMPRESSION,
                compressed_size=len(compressed),
                uncompressed_size=chunk.uncompressed_size,
            )
        )
        self._begin_chunk()

    def _statistics(self) -> Statistics:
        chunks = self._chunks
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(chunks),
            message_count=sum(self._counts.values()),
            metadata_count=len(self._metadata),
            message_start_time=min((c.message_start_time for c in chunks), default=0),
            message_end_time=max((c.message_end_time for c in chunks), default=0),
            schema_count=len(self._schemas),
        )

    def _write(self, data: bytes) -> int:
        """Write bytes that the checksum of the data covers; return how many."""
        self._crc = zlib.crc32(data, self._crc)
        self._file.write(data)
        return len(data)


def _message_index(channel_id: int, index: Sequence[int]) -> bytes:
    """Return the record of a channel's times and offsets, which alternate."""
    size = 8 * len(index)
    head = _INDEX.pack(Opcode.MESSAGE_INDEX, 2 + 4 + size, channel_id, size)
    return head + struct.pack(f"<{len(index)}Q", *index)


def _write_all(records: Sequence[_Written], builder: RecordBuilder) -> None:
    for record in records:
        record.write(builder)


def _bytes_of(record: _Written) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
