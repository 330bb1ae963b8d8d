"""Packed parts of a log, unpacked within bounds: a bomb is refused, not unpacked."""

from __future__ import annotations

import bz2
from typing import Any

import lz4.frame  # pyright: ignore[reportMissingTypeStubs]
import zstandard

LARGEST_PART = 64 * 2**20  # bytes of a chunk, unpacked
LARGEST_RATIO = 100  # of a part unpacked to the same part packed
_SMALL = 2**20  # bytes that any part may unpack to, whatever its ratio
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


class UnpackError(ValueError):
    """A packed part is damaged or larger than it may be; the text says which."""


def room_for(packed: int) -> int:
    """Return how many bytes a part of `packed` bytes may unpack to."""
    return min(LARGEST_PART, max(_SMALL, LARGEST_RATIO * packed))


def unpacked(data: bytes, compression: str, size: int | None = None) -> bytes:
    """Return a packed part.

    Args:
        data: as it is stored.
        compression: "none", "bz2", "lz4" or "zstd".
        size: bytes that it is said to unpack to; None = not said.

    Raises:
        UnpackError: it is damaged, of another size, or unpacks to too much.
    """
    most = room_for(len(data))
    if size is not None and size > most:
        raise UnpackError(f"a part states {size} bytes unpacked, {len(data)} packed")
    try:
        found = _UNPACKERS[compression](data, most)
    except KeyError as error:
        raise UnpackError(f"compression {compression[:20]!r} is not known") from error
    except (OSError, EOFError, RuntimeError, ValueError, MemoryError) as error:
        raise UnpackError(f"a packed part is damaged ({error})") from error
    except zstandard.ZstdError as error:
        raise UnpackError(f"a packed part is damaged ({error})") from error
    if len(found) > most:
        raise UnpackError(f"a part of {len(data)} bytes unpacks to over {most}")
    if size is not None and len(found) != size:
        raise UnpackError(f"a part has {len(found)} bytes, it states {size}")
    return found


def _plain(data: bytes, _: int) -> bytes:
    return data


def _bz2(data: bytes, most: int) -> bytes:
    unpacker = bz2.BZ2Decompressor()
    return _whole(unpacker.decompress(data, most + 1), unpacker.eof, most)


def _lz4(data: bytes, most: int) -> bytes:
    unpacker: Any = lz4.frame.LZ4FrameDecompressor()
    return _whole(unpacker.decompress(data, most + 1), unpacker.eof, most)


def _zstd(data: bytes, most: int) -> bytes:
    unpacker = zstandard.ZstdDecompressor(max_window_size=LARGEST_PART)
    with unpacker.stream_reader(data) as stream:
        return stream.read(most + 1)


def _whole(found: bytes, is_whole: bool, most: int) -> bytes:
    if not is_whole and len(found) <= most:
        raise ValueError("it ends too early")
    return found


_UNPACKERS = {"": _plain, "none": _plain, "bz2": _bz2, "lz4": _lz4, "zstd": _zstd}
