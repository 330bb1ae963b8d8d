"""Scanner of MCAP records, for trials, damaged trials, and logs of other programs.

`records_of` iterates over the records in a buffer, `record_at` returns one of them,
`records_in` iterates over those of a file of any size. Lengths are checked before
anything is read or allocated. `parse_chunk` and `unpacked` unpack a chunk within bounds
and verify its checksum; `parse` returns other records as values of the mcap library.
The caller decides on damage: the reader of trials refuses the file, `salvage` continues
after it, a log ends there.

Format: https://mcap.dev/spec.
"""

import io
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from io import BufferedReader
from typing import Any, NamedTuple, TypeVar, cast

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, McapRecord, Message, Metadata

from acquisition.trial_file.unpacking import DamageError, Unpacker

MAGIC = b"\x89MCAP0\r\n"
HEAD_BYTES = 9  # opcode and length, not included in the length
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
# Exceptions that a damaged record can cause.
DAMAGE = (McapError, struct.error, ValueError, KeyError, MemoryError, OverflowError)
_MIB = 2**20
_HEAD = struct.Struct("<BQ")  # opcode, length
_CHUNK = struct.Struct("<QQQII")  # start, end, size, crc, length of the compression
_STORED = struct.Struct("<Q")  # stored size of a chunk
_LONGEST_NAME = 16  # of a compression
_CRC = struct.Struct("<I")  # at the end of an attachment
_LENGTH = struct.Struct("<I")  # of a text, and of the texts of a mapping
_MESSAGE_INDEX = struct.Struct("<HI")  # channel, bytes of the pairs behind it
_PAIR_BYTES = 16  # log time, offset in the chunk
_INDEX_HEAD = struct.Struct("<QQQQI")  # start, end, offset, length, bytes of offsets
_INDEX_OFFSET = struct.Struct("<HQ")  # channel, offset of its message index
_INDEX_TAIL = struct.Struct("<QI")  # length of the indexes, length of the compression
_INDEX_SIZES = struct.Struct("<QQ")  # packed, unpacked
_Record = TypeVar("_Record", bound=McapRecord)


class RawRecord(NamedTuple):
    """A record as stored.

    Attributes:
        opcode: kind of the record.
        body: content.
        end: offset of the next record.
    """

    opcode: int
    body: memoryview
    end: int


def records_of(
    data: memoryview, at: int = 0, what: str = "data"
) -> Iterator[RawRecord]:
    """Yield the records in a buffer.

    Args:
        data: the buffer.
        at: offset of the first record.
        what: name of the buffer in an error.

    Raises:
        DamageError: the last record is incomplete.
    """
    size = len(data)
    while at < size:
        start = at + HEAD_BYTES
        opcode, length = _HEAD.unpack_from(data, at) if start <= size else (0, size)
        at = start + length
        if at > size:
            raise DamageError(f"{what} that ends in a record")
        yield RawRecord(opcode, data[start:at], at)


def record_at(data: memoryview, offset: int) -> RawRecord | None:
    """Return the record at `offset`, None if it is incomplete."""
    try:
        return next(records_of(data, offset), None)
    except DamageError:
        return None


def body_at(data: memoryview, offset: int, opcode: Opcode) -> memoryview:
    """Return the body of the record of kind `opcode` at `offset`.

    Raises:
        DamageError: there is no such record.
    """
    raw = record_at(data, offset)
    if raw is None or raw.opcode != opcode:
        raise DamageError(f"no {opcode.name.lower()} at byte {offset}")
    return raw.body


def records_in(file: BufferedReader, largest: int) -> Iterator[RawRecord]:
    """Yield the records of a file's data section, one in memory at a time.

    Args:
        file: an MCAP file, positioned after its magic.
        largest: largest accepted record [bytes].

    Raises:
        DamageError: a record is too large or truncated, or the end record is missing.
        OSError: the file cannot be read.
    """
    at, size = file.tell(), os.fstat(file.fileno()).st_size
    while len(head := file.read(HEAD_BYTES)) == HEAD_BYTES:
        opcode, length = _HEAD.unpack(head)
        if opcode == Opcode.DATA_END:
            return
        at += HEAD_BYTES + length
        if length > largest:
            raise DamageError(f"a record of {length} bytes")
        if at > size:
            raise DamageError("the file is cut there")
        yield RawRecord(opcode, memoryview(file.read(length)), at)
    raise DamageError("the file ends without its end mark")


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk as stored.

    Attributes:
        start_ns: stated smallest log time [ns].
        end_ns: stated largest log time [ns].
        size: stated unpacked size [bytes].
        crc: CRC-32 of the unpacked bytes; 0 = none.
        compression: "", "lz4" or "zstd".
        packed: stored bytes.
    """

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    packed: memoryview


def parse_chunk(body: memoryview, largest: int) -> Chunk:
    """Parse the body of a chunk record.

    Args:
        body: body of the record.
        largest: largest accepted unpacked size [bytes].

    Raises:
        DamageError: impossible sizes or unknown compression.
    """
    if len(body) < _CHUNK.size:
        raise DamageError("a chunk of impossible length")
    start_ns, end_ns, size, crc, name_bytes = _CHUNK.unpack_from(body)
    if size > largest:
        raise DamageError(f"a chunk that states over {largest // _MIB} MiB")
    name = bytes(body[_CHUNK.size : _CHUNK.size + min(name_bytes, _LONGEST_NAME)])
    if name not in (b"", b"lz4", b"zstd") or name_bytes != len(name):
        text = name.decode(errors="replace")
        raise DamageError(f"a chunk of compression {text!r}, expected zstd or lz4")
    at = _CHUNK.size + name_bytes
    packed = body[at + _STORED.size :]
    if len(body) < at + _STORED.size or _STORED.unpack_from(body, at)[0] != len(packed):
        raise DamageError("a chunk of impossible length")
    return Chunk(start_ns, end_ns, size, crc, name.decode(), packed)


def unpacked(chunk: Chunk, unpacker: Unpacker) -> memoryview:
    """Return the unpacked records of a chunk, at most the stated size.

    Raises:
        DamageError: the content is damaged or of another size than stated.
    """
    data = unpacker.unpack(chunk.packed, chunk.compression, chunk.size)
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise DamageError("a chunk whose checksum is wrong")
    return memoryview(data)


def parse(kind: type[_Record], body: memoryview) -> _Record:
    """Return a record as a value of the mcap library, e.g. `parse(Metadata, body)`.

    Raises:
        one of `DAMAGE`: not a valid record of this kind.
    """
    parser = _PARSERS.get(kind)
    if parser is not None:
        return parser(body)
    # From memory: a false length of a field cannot read beyond the body.
    stream = ReadDataStream(io.BytesIO(body))
    return cast("Any", kind).read(stream)


def message_of(body: memoryview) -> Message:
    """Parse a message; raises struct.error if it is too short."""
    channel, sequence, log_time, publish_time = MESSAGE.unpack_from(body)
    content = bytes(body[MESSAGE.size :])
    return Message(channel, log_time, content, publish_time, sequence)


def message_index(body: memoryview) -> tuple[int, memoryview]:
    """Return the channel of a message index and its (log time, offset) pairs.

    Each value has eight bytes; offsets are those of records in the chunk.

    Raises:
        DamageError: wrong length.
    """
    if len(body) >= _MESSAGE_INDEX.size:
        channel, size = _MESSAGE_INDEX.unpack_from(body)
        pairs = body[_MESSAGE_INDEX.size :]
        if size == len(pairs) and size % _PAIR_BYTES == 0:
            return channel, pairs
    raise DamageError("a damaged message index")


def has_checksum(attachment: memoryview) -> bool:
    """Return whether the checksum of an attachment is correct."""
    stated = _CRC.unpack(attachment[-_CRC.size :])[0]
    return zlib.crc32(attachment[: -_CRC.size]) == stated


def is_whole_metadata(body: memoryview) -> bool:
    """Return whether metadata fill their body exactly; they have no checksum.

    Raises:
        one of `DAMAGE`: not valid metadata.
    """
    name_bytes, metadata = _LENGTH.unpack_from(body)[0], _metadata(body)
    end = 2 * _LENGTH.size + name_bytes
    end += _LENGTH.unpack_from(body, end - _LENGTH.size)[0]
    return bool(metadata.metadata) and end == len(body)


def _metadata(body: memoryview) -> Metadata:
    """Parse metadata and check the stated lengths."""
    name, at = _text_at(body, 0)
    (size,) = _LENGTH.unpack_from(body, at)
    at, end = at + _LENGTH.size, at + _LENGTH.size + size
    if end > len(body):
        raise DamageError("metadata that end too early")
    values: dict[str, str] = {}
    while at < end:
        key, at = _text_at(body, at)
        values[key], at = _text_at(body, at)
    if at != end:
        raise DamageError("metadata that end too late")
    return Metadata(name=name, metadata=values)


def _text_at(body: memoryview, at: int) -> tuple[str, int]:
    """Return the string at an offset and the offset after it."""
    (length,) = _LENGTH.unpack_from(body, at)
    start, end = at + _LENGTH.size, at + _LENGTH.size + length
    if end > len(body):
        raise DamageError("a text that ends too early")
    return str(body[start:end], "utf-8"), end


def _chunk_index(body: memoryview) -> ChunkIndex:
    """Parse a chunk index with few calls; a file has hundreds of them."""
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


_PARSERS: Mapping[type[McapRecord], Callable[[memoryview], Any]] = {
    Metadata: _metadata,
    ChunkIndex: _chunk_index,
}
