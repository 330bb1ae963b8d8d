"""Contents of a trial file other than messages: summary, metadata, attachments."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.summary import Summary

from acquisition.errors import TrialFileError
from acquisition.trial_file.checksums import check_sections
from acquisition.trial_file.data_files import read_data
from acquisition.trial_file.records import (
    DAMAGE,
    MAGIC,
    body_at,
    parse,
    records_of,
)
from acquisition.trial_file.unpacking import DamageError

RECORD_LIMIT = 16 * 2**20  # bytes of a record, and of an unpacked chunk
MAX_CHUNKS = 100_000
MAX_NAMED = 1_000  # metadata records and attachments
MAX_METADATA = 2**20  # bytes of one metadata record
MAX_SUMMARY = 8 * 2**20  # bytes; two hours of chunks take half of it
_SUMMARY: Mapping[int, type[McapRecord]] = {
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
}
_UNPACKED_FLOOR = 64 * 2**20
_UNPACKED_RATIO = 100  # compression of an arm at rest is 20, of zeros 1000
_UNPACKED_MOST = 192 * 2**20  # ten minutes of cycles


@contextmanager
def as_trial_file_error(path: Path) -> Generator[None]:
    """Convert any error caused by a damaged file to a TrialFileError."""
    try:
        yield
    except TrialFileError:
        raise
    except DamageError as error:
        raise TrialFileError(path, f"has {error}") from error
    except (*DAMAGE, OSError) as error:
        detail = str(error) or type(error).__name__
        raise TrialFileError(
            path, f"is not a readable trial file ({detail})"
        ) from error


def read_file(path: Path) -> bytes:
    """Return the content of a file; never blocks on a pipe or device.

    Raises:
        TrialFileError: the file cannot be read, is not a regular file, or is too large.
    """
    with as_trial_file_error(path):
        return read_data(path)


def unpacked_limit(file_bytes: int) -> int:
    """Return the limit of the total unpacked size of a file's chunks [bytes]."""
    return min(_UNPACKED_MOST, _UNPACKED_FLOOR + _UNPACKED_RATIO * file_bytes)


@dataclass(frozen=True, slots=True)
class Contents:
    """A complete MCAP file with verified checksums.

    Attributes:
        data: data section.
        size: size of the file [bytes].
        summary: channels, schemas, statistics and chunk offsets.
        metadata: metadata by name.
        attachments: contents by name; the names are not paths.
    """

    data: memoryview
    size: int
    summary: Summary
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]


def read_contents(path: Path) -> Contents:
    """Read the whole file and check the claims of its summary.

    Raises:
        TrialFileError: the file is missing, foreign, truncated, damaged or hostile.
    """
    data = read_file(path)
    with as_trial_file_error(path):
        sections = check_sections(data, path)
        if sections.footer - sections.summary > MAX_SUMMARY:
            raise DamageError("a summary of over 8 MiB")
        whole = memoryview(data)
        _check_profile(whole, path)
        summary = _read_summary(whole[sections.summary : sections.footer])
        if summary.statistics is None:
            raise DamageError("no summary: was it closed properly?")
        body = whole[: sections.data_end]
        _check_chunks(summary, len(body), len(data), path)
        _check_named(summary, len(data), path)
        metadata = [_metadata(body, i) for i in summary.metadata_indexes]
        attachments = [_attachment(body, i) for i in summary.attachment_indexes]
    return Contents(
        data=body,
        size=len(data),
        summary=summary,
        metadata={m.name: dict(m.metadata) for m in metadata},
        attachments={a.name: a.data for a in attachments},
    )


def _check_profile(data: memoryview, path: Path) -> None:
    header = parse(Header, body_at(data, len(MAGIC), Opcode.HEADER))
    if header.profile != "ros2":
        raise TrialFileError(path, f"has profile {header.profile[:20]!r}, not ros2")


def _read_summary(data: memoryview) -> Summary:
    summary = Summary()
    for raw in records_of(data, what="a summary"):
        if (kind := _SUMMARY.get(raw.opcode)) is not None:
            _add_record(summary, parse(kind, raw.body))
    return summary


def _add_record(summary: Summary, record: McapRecord) -> None:
    match record:
        case ChunkIndex():
            summary.chunk_indexes.append(record)
        case Statistics():
            summary.statistics = record
        case Schema():
            summary.schemas[record.id] = record
        case Channel():
            summary.channels[record.id] = record
        case MetadataIndex():
            summary.metadata_indexes.append(record)
        case AttachmentIndex():
            summary.attachment_indexes.append(record)
        case _:
            pass


def _check_chunks(summary: Summary, end: int, size: int, path: Path) -> None:
    chunks = summary.chunk_indexes
    total = sum(chunk.uncompressed_size for chunk in chunks)
    if len(chunks) > MAX_CHUNKS or total > unpacked_limit(size):
        raise TrialFileError(path, f"states {len(chunks)} chunks of {total} bytes")
    for chunk in chunks:
        if chunk.uncompressed_size > RECORD_LIMIT:
            raise DamageError("a chunk that states over 16 MiB")
        if chunk.chunk_start_offset + chunk.chunk_length > end:
            raise DamageError("a chunk beyond its end")


def _check_named(summary: Summary, size: int, path: Path) -> None:
    """Refuse more metadata and attachments than fit in the file."""
    indexes = (summary.metadata_indexes, summary.attachment_indexes)
    if max(len(raw) for raw in indexes) > MAX_NAMED:
        raise TrialFileError(path, f"states over {MAX_NAMED} attachments")
    if sum(index.length for raw in indexes for index in raw) > size:
        raise TrialFileError(path, "states attachments larger than itself")


def _metadata(data: memoryview, index: MetadataIndex) -> Metadata:
    body = body_at(data, index.offset, Opcode.METADATA)
    if len(body) > min(index.length, MAX_METADATA):
        raise DamageError("metadata of impossible length")
    return parse(Metadata, body)


def _attachment(data: memoryview, index: AttachmentIndex) -> Attachment:
    body = body_at(data, index.offset, Opcode.ATTACHMENT)
    if len(body) > min(index.length, RECORD_LIMIT):
        raise DamageError("an attachment of impossible length")
    return parse(Attachment, body)
