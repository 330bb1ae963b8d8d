"""Records and chunks of an MCAP file as bytes; sizes are checked before unpacking."""

import struct
import zlib
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lz4.frame  # pyright: ignore[reportMissingTypeStubs]
import zstandard
from mcap.exceptions import McapError

from acquisition.errors import TrialFileError
from acquisition.trial_file.data_files import read_data

RECORD_LIMIT = 16 * 2**20  # bytes of one record, and of one chunk unpacked
_UNPACKED_FLOOR = 64 * 2**20
_UNPACKED_RATIO = 100  # an arm at rest packs twenty times, zeros a thousand times
_UNPACKED_MOST = 192 * 2**20  # ten minutes of cycles
_RECORD = struct.Struct("<BQ")  # opcode, length
_CHUNK = struct.Struct("<QQQII")  # start, end, size, crc, length of the compression
_STORED = struct.Struct("<Q")
_LONGEST_NAME = 16

_ERRORS = (
    McapError,
    struct.error,
    ValueError,
    KeyError,
    OSError,
    MemoryError,
    OverflowError,
    RuntimeError,
    zstandard.ZstdError,
)


@contextmanager
def as_trial_file_error(path: Path) -> Generator[None]:
    """Turn whatever a damaged file can raise into a TrialFileError."""
    try:
        yield
    except TrialFileError:
        raise
    except _ERRORS as error:
        detail = str(error) or type(error).__name__
        raise TrialFileError(
            path, f"is not a readable trial file ({detail})"
        ) from error


def read_file(path: Path) -> bytes:
    """Return the whole file; a pipe or device is not waited for.

    Raises:
        TrialFileError: it cannot be read, is not a regular file, or is beyond all size.
    """
    with as_trial_file_error(path):
        return read_data(path)


def unpacked_limit(file_bytes: int) -> int:
    """Return how many bytes all chunks of a file of `file_bytes` may unpack to."""
    return min(_UNPACKED_MOST, _UNPACKED_FLOOR + _UNPACKED_RATIO * file_bytes)


@dataclass(frozen=True, slots=True)
class RawRecord:
    """A record in a buffer.

    Attributes:
        opcode: its kind.
        body: its content, a view into the buffer.
        end: offset behind it.
    """

    opcode: int
    body: memoryview
    end: int


def record_at(data: memoryview, offset: int) -> RawRecord | None:
    """Return the record at `offset`, None where the buffer does not hold all of it."""
    start = offset + _RECORD.size
    if offset < 0 or start > len(data):
        return None
    opcode, length = _RECORD.unpack_from(data, offset)
    if length > len(data) - start:
        return None
    return RawRecord(opcode, data[start : start + length], start + length)


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


def parse_chunk(body: memoryview, path: Path) -> Chunk:
    """Take the body of a chunk record apart.

    Raises:
        TrialFileError: it states impossible sizes or an unknown compression.
    """
    if len(body) < _CHUNK.size:
        raise TrialFileError(path, "has a chunk of impossible length")
    start_ns, end_ns, size, crc, name_bytes = _CHUNK.unpack_from(body)
    if size > RECORD_LIMIT:
        raise TrialFileError(path, "has a chunk that states over 16 MiB")
    name = bytes(body[_CHUNK.size : _CHUNK.size + min(name_bytes, _LONGEST_NAME)])
    if name not in (b"", b"lz4", b"zstd") or name_bytes != len(name):
        text = name.decode(errors="replace")
        raise TrialFileError(path, f"uses compression {text!r}, expected zstd")
    at = _CHUNK.size + name_bytes
    packed = body[at + _STORED.size :]
    if len(body) < at + _STORED.size or _STORED.unpack_from(body, at)[0] != len(packed):
        raise TrialFileError(path, "has a chunk of impossible length")
    return Chunk(start_ns, end_ns, size, crc, name.decode(), packed)


class Unpacker:
    """Unpacks chunks of one file; not for two threads at once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._zstd = zstandard.ZstdDecompressor(max_window_size=RECORD_LIMIT)

    def unpack(self, chunk: Chunk) -> bytes:
        """Return the records in a chunk; never more bytes than the chunk states.

        Raises:
            TrialFileError: its content is damaged or of another size than stated.
        """
        with as_trial_file_error(self._path):
            if chunk.compression == "zstd":
                data = self._unzstd(chunk)
            elif chunk.compression == "lz4":
                data = self._unlz4(chunk)
            else:
                data = bytes(chunk.packed)
        if len(data) != chunk.size or (chunk.crc and zlib.crc32(data) != chunk.crc):
            raise TrialFileError(self._path, "has a chunk whose checksum is wrong")
        return data

    def _unzstd(self, chunk: Chunk) -> bytes:
        """Unpack a zstd frame; it may leave its size out, but not state another one."""
        stated = zstandard.frame_content_size(chunk.packed)
        if stated not in (-1, chunk.size):
            raise TrialFileError(
                self._path, f"has a chunk that would unpack to {stated} bytes"
            )
        return self._zstd.decompress(chunk.packed, max_output_size=chunk.size)

    def _unlz4(self, chunk: Chunk) -> bytes:
        unpacker: Any = lz4.frame.LZ4FrameDecompressor()
        # one byte at least: asked for none, it would not look for the end of the frame
        data: bytes = unpacker.decompress(chunk.packed, max_length=max(chunk.size, 1))
        if not unpacker.eof:
            raise TrialFileError(
                self._path, f"has a chunk of more than {chunk.size} bytes"
            )
        return data
