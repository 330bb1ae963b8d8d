"""Scanner of MCAP records: trials, what is left of them, and logs of other programs.

`records_of` frames the records in a buffer, `record_at` one of them, `records_in` those
of a file of any size, one at a time. A length is checked against what there is
before anything is read or allocated for it. `parse_chunk` and `unpacked` open a chunk
within bounds and hold it against its checksum; `parse` gives the other records as the
values of the mcap library. Who reads decides what damage means: the reader of trials
refuses the file, `salvage` goes on behind it, a log ends there.

Form: https://mcap.dev/spec.
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
HEAD_BYTES = 9  # opcode and length, which the length does not count
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
# What a damaged record can raise where it is read.
DAMAGE = (McapError, struct.error, ValueError, KeyError, MemoryError, OverflowError)
_MIB = 2**20
_HEAD = struct.Struct("<BQ")  # opcode, length
_CHUNK = struct.Struct("<QQQII")  # start, end, size, crc, length of the compression
_STORED = struct.Struct("<Q")  # bytes of a chunk as it is stored
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
    """A record as it is stored.

    Attributes:
        opcode: its kind.
        body: its content.
        end: offset behind it.
    """

    opcode: int
    body: memoryview
    end: int


def records_of(
    data: memoryview, at: int = 0, what: str = "data"
) -> Iterator[RawRecord]:
    """Give the records that fill a buffer.

    Args:
        data: the buffer.
        at: where the first one begins.
        what: the buffer is called if it is damaged.

    Raises:
        DamageError: the last one leads out of it.
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
    """Return the record at `offset`, None where the buffer does not hold all of it."""
    try:
        return next(records_of(data, offset), None)
    except DamageError:
        return None


def body_at(data: memoryview, offset: int, opcode: Opcode) -> memoryview:
    """Return the body of the record of kind `opcode` at `offset`.

    Raises:
        DamageError: there is none.
    """
    raw = record_at(data, offset)
    if raw is None or raw.opcode != opcode:
        raise DamageError(f"no {opcode.name.lower()} at byte {offset}")
    return raw.body


def records_in(file: BufferedReader, largest: int) -> Iterator[RawRecord]:
    """Give the records of a file up to the end of its data; one is in memory.

    Args:
        file: an MCAP file, behind its magic.
        largest: bytes that a record may have.

    Raises:
        DamageError: a record is larger, or cut off, or the data have no end.
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
    """A chunk as it is stored.

    Attributes:
        start_ns: smallest log time in it, as it says [ns].
        end_ns: largest log time in it, as it says [ns].
        size: bytes unpacked, as it says.
        crc: CRC-32 of the unpacked bytes; 0 = none.
        compression: "", "lz4" or "zstd".
        packed: the stored bytes.
    """

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    packed: memoryview


def parse_chunk(body: memoryview, largest: int) -> Chunk:
    """Take the body of a chunk record apart.

    Args:
        body: of the record.
        largest: bytes that it may state unpacked.

    Raises:
        DamageError: it states impossible sizes or an unknown compression.
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
    """Return the records in a chunk; never more bytes than the chunk states.

    Raises:
        DamageError: its content is damaged or of another size than stated.
    """
    data = unpacker.unpack(chunk.packed, chunk.compression, chunk.size)
    if chunk.crc and zlib.crc32(data) != chunk.crc:
        raise DamageError("a chunk whose checksum is wrong")
    return memoryview(data)


def parse(kind: type[_Record], body: memoryview) -> _Record:
    """Return a record as a value of the mcap library, e.g. `parse(Metadata, body)`.

    Raises:
        one of `DAMAGE`: it is no such record.
    """
    own = _PARSERS.get(kind)
    if own is not None:
        return own(body)
    # From memory: whatever length a field states, no more than the body is read.
    stream = ReadDataStream(io.BytesIO(body))
    return cast("Any", kind).read(stream)


def message_of(body: memoryview) -> Message:
    """Return a message; raises struct.error where it is too short for one."""
    channel, sequence, log_time, publish_time = MESSAGE.unpack_from(body)
    content = bytes(body[MESSAGE.size :])
    return Message(channel, log_time, content, publish_time, sequence)


def message_index(body: memoryview) -> tuple[int, memoryview]:
    """Return the channel of a message index, and its pairs of log time and offset.

    Each is eight bytes; the offset is that of a record in the chunk.

    Raises:
        DamageError: they do not fill it.
    """
    if len(body) >= _MESSAGE_INDEX.size:
        channel, size = _MESSAGE_INDEX.unpack_from(body)
        pairs = body[_MESSAGE_INDEX.size :]
        if size == len(pairs) and size % _PAIR_BYTES == 0:
            return channel, pairs
    raise DamageError("a damaged message index")


def has_checksum(attachment: memoryview) -> bool:
    """Return whether the body of an attachment is as it was written."""
    stated = _CRC.unpack(attachment[-_CRC.size :])[0]
    return zlib.crc32(attachment[: -_CRC.size]) == stated


def is_whole_metadata(body: memoryview) -> bool:
    """Return whether metadata fill their body; they have no checksum of their own.

    Raises:
        one of `DAMAGE`: they are no metadata.
    """
    name_bytes, metadata = _LENGTH.unpack_from(body)[0], _metadata(body)
    end = 2 * _LENGTH.size + name_bytes
    end += _LENGTH.unpack_from(body, end - _LENGTH.size)[0]
    return bool(metadata.metadata) and end == len(body)


def _metadata(body: memoryview) -> Metadata:
    """Take metadata apart; their texts fill what they state."""
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
    """Return a text and the offset behind it; several hundred are in a file."""
    (length,) = _LENGTH.unpack_from(body, at)
    start, end = at + _LENGTH.size, at + _LENGTH.size + length
    if end > len(body):
        raise DamageError("a text that ends too early")
    return str(body[start:end], "utf-8"), end


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


_PARSERS: Mapping[type[McapRecord], Callable[[memoryview], Any]] = {
    Metadata: _metadata,
    ChunkIndex: _chunk_index,
}
