"""What a trial file holds beside its messages: summary, metadata, attachments."""

import io
import struct
from dataclasses import dataclass
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.summary import Summary

from acquisition.errors import TrialFileError
from acquisition.trial_file.checksums import MAGIC, check_sections
from acquisition.trial_file.chunks import (
    RECORD_LIMIT,
    RawRecord,
    as_trial_file_error,
    read_file,
    record_at,
    unpacked_limit,
)

MAX_CHUNKS = 100_000
MAX_NAMED = 1_000  # metadata records and attachments
MAX_METADATA = 2**20  # bytes of one metadata record
MAX_SUMMARY = 8 * 2**20  # bytes; two hours of chunks need half of it
_LENGTH = struct.Struct("<I")  # of a text, and of the texts of a mapping
_INDEX_HEAD = struct.Struct("<QQQQI")  # start, end, offset, length, bytes of offsets
_INDEX_OFFSET = struct.Struct("<HQ")  # channel, offset of its message index
_INDEX_TAIL = struct.Struct("<QI")  # length of the indexes, length of the compression
_INDEX_SIZES = struct.Struct("<QQ")  # packed, unpacked


@dataclass(frozen=True, slots=True)
class Contents:
    """A whole MCAP file whose sections have the right checksums.

    Attributes:
        path: the file.
        data: its data section, a view of all that was read.
        size: bytes of the file.
        summary: channels, schemas, statistics and where the chunks lie.
        metadata: metadata by name.
        attachments: content by name; the names are no paths.
    """

    path: Path
    data: memoryview
    size: int
    summary: Summary
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]

    def record(self, offset: int, opcode: Opcode) -> memoryview:
        """Return the body of the record of kind `opcode` at `offset`.

        Raises:
            TrialFileError: there is none in the data section.
        """
        return _record(self.data, offset, opcode, self.path)


def read_contents(path: Path) -> Contents:
    """Read the whole file and check all that its summary states.

    Raises:
        TrialFileError: the file is missing, foreign, truncated, damaged or hostile.
    """
    data = read_file(path)
    with as_trial_file_error(path):
        sections = check_sections(data, path)
        if sections.footer - sections.summary > MAX_SUMMARY:
            raise TrialFileError(path, "has a summary of over 8 MiB")
        whole = memoryview(data)
        summary = _read_summary(whole, sections.summary, sections.footer, path)
        _check_chunks(summary, sections.data_end, len(data), path)
        _check_named(summary, len(data), path)
        body = whole[: sections.data_end]
        metadata = [_metadata(body, i, path) for i in summary.metadata_indexes]
        attachments = [_attachment(body, i, path) for i in summary.attachment_indexes]
    return Contents(
        path=path,
        data=body,
        size=len(data),
        summary=summary,
        metadata={m.name: dict(m.metadata) for m in metadata},
        attachments={a.name: a.data for a in attachments},
    )


def _read_summary(data: memoryview, start: int, end: int, path: Path) -> Summary:
    """Return the summary, which fills the bytes from `start` to `end`."""
    header = Header.read(_stream(_record(data, len(MAGIC), Opcode.HEADER, path)))
    if header.profile != "ros2":
        raise TrialFileError(path, f"has profile {header.profile[:20]!r}, not ros2")
    summary = Summary()
    while start < end:
        raw = record_at(data[:end], start)
        if raw is None:
            raise TrialFileError(path, "has a damaged summary")
        _add_record(summary, raw)
        start = raw.end
    if summary.statistics is None:
        raise TrialFileError(path, "has no summary: was it closed properly?")
    return summary


def _add_record(summary: Summary, raw: RawRecord) -> None:
    match raw.opcode:
        case Opcode.CHUNK_INDEX:
            summary.chunk_indexes.append(_chunk_index(raw.body))
        case Opcode.STATISTICS:
            summary.statistics = Statistics.read(_stream(raw.body))
        case Opcode.SCHEMA:
            schema = Schema.read(_stream(raw.body))
            summary.schemas[schema.id] = schema
        case Opcode.CHANNEL:
            channel = Channel.read(_stream(raw.body))
            summary.channels[channel.id] = channel
        case Opcode.METADATA_INDEX:
            summary.metadata_indexes.append(MetadataIndex.read(_stream(raw.body)))
        case Opcode.ATTACHMENT_INDEX:
            summary.attachment_indexes.append(AttachmentIndex.read(_stream(raw.body)))
        case _:
            pass


def _chunk_index(body: memoryview) -> ChunkIndex:
    """Take a chunk index apart in four steps; there are hundreds in a file."""
    start_ns, end_ns, offset, length, offset_bytes = _INDEX_HEAD.unpack_from(body)
    at = _INDEX_HEAD.size + offset_bytes
    offsets = dict(_INDEX_OFFSET.iter_unpack(body[_INDEX_HEAD.size : at]))
    index_length, name_bytes = _INDEX_TAIL.unpack_from(body, at)
    at += _INDEX_TAIL.size
    packed, size = _INDEX_SIZES.unpack_from(body, at + name_bytes)
    return ChunkIndex(
        chunk_length=length,
        chunk_start_offset=offset,
        compression=str(body[at : at + name_bytes], "utf-8"),
        compressed_size=packed,
        message_end_time=end_ns,
        message_index_length=index_length,
        message_index_offsets=offsets,
        message_start_time=start_ns,
        uncompressed_size=size,
    )


def _stream(body: memoryview) -> ReadDataStream:
    # From memory: whatever length a field states, no more than the body is read.
    return ReadDataStream(io.BytesIO(body))


def _check_chunks(summary: Summary, end: int, size: int, path: Path) -> None:
    chunks = summary.chunk_indexes
    total = sum(chunk.uncompressed_size for chunk in chunks)
    if len(chunks) > MAX_CHUNKS or total > unpacked_limit(size):
        raise TrialFileError(path, f"states {len(chunks)} chunks of {total} bytes")
    for chunk in chunks:
        if chunk.uncompressed_size > RECORD_LIMIT:
            raise TrialFileError(path, "has a chunk that states over 16 MiB")
        if chunk.chunk_start_offset + chunk.chunk_length > end:
            raise TrialFileError(path, "has a chunk beyond its end")


def _check_named(summary: Summary, size: int, path: Path) -> None:
    """Refuse more metadata and attachments than can lie beside each other."""
    indexes = (summary.metadata_indexes, summary.attachment_indexes)
    if max(len(raw) for raw in indexes) > MAX_NAMED:
        raise TrialFileError(path, f"states over {MAX_NAMED} attachments")
    if sum(index.length for raw in indexes for index in raw) > size:
        raise TrialFileError(path, "states attachments larger than itself")


def _metadata(data: memoryview, index: MetadataIndex, path: Path) -> Metadata:
    body = _record(data, index.offset, Opcode.METADATA, path)
    if len(body) > min(index.length, MAX_METADATA):
        raise TrialFileError(path, "has metadata of impossible length")
    name, at = _text_at(body, 0)
    (size,) = _LENGTH.unpack_from(body, at)
    at, end = at + _LENGTH.size, at + _LENGTH.size + size
    if end > len(body):
        raise TrialFileError(path, "has metadata that end too early")
    values: dict[str, str] = {}
    while at < end:
        key, at = _text_at(body, at)
        values[key], at = _text_at(body, at)
    return Metadata(name=name, metadata=values)


def _text_at(body: memoryview, at: int) -> tuple[str, int]:
    """Return a text and the offset behind it; several hundred are in a file."""
    (length,) = _LENGTH.unpack_from(body, at)
    start, end = at + _LENGTH.size, at + _LENGTH.size + length
    if end > len(body):
        raise ValueError("a text that ends too early")
    return str(body[start:end], "utf-8"), end


def _attachment(data: memoryview, index: AttachmentIndex, path: Path) -> Attachment:
    body = _record(data, index.offset, Opcode.ATTACHMENT, path)
    if len(body) > min(index.length, RECORD_LIMIT):
        raise TrialFileError(path, "has an attachment of impossible length")
    return Attachment.read(_stream(body))


def _record(data: memoryview, offset: int, opcode: Opcode, path: Path) -> memoryview:
    raw = record_at(data, offset)
    if raw is None or raw.opcode != opcode:
        raise TrialFileError(path, f"has no {opcode.name.lower()} at byte {offset}")
    return raw.body
