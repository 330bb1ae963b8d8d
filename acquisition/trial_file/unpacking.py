"""Decompression within size limits: decompression bombs are refused."""

import bz2
from typing import Any, BinaryIO

import lz4.frame  # pyright: ignore[reportMissingTypeStubs]
import zstandard

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_SMALL = 2**20  # unpacked size accepted at any ratio [bytes]
_ERRORS = (OSError, EOFError, RuntimeError, ValueError, MemoryError)
Packed = bytes | memoryview


class DamageError(ValueError):
    """Stored data are damaged or too large; the text is a noun phrase for them."""


class Unpacker:
    """Decompressor for the parts of one file; not thread-safe."""

    def __init__(self, largest: int, ratio: int | None = None) -> None:
        """Set the limits.

        Args:
            largest: largest unpacked size of a part [bytes].
            ratio: largest compression ratio of a part above 1 MiB; None = any.
        """
        self._largest = largest
        self._ratio = ratio
        self._zstd = zstandard.ZstdDecompressor(max_window_size=largest)

    def unpack(
        self, packed: Packed, compression: str, size: int | None = None
    ) -> bytes:
        """Unpack a part, up to the limits and `size`.

        Args:
            packed: stored bytes.
            compression: "" or "none", "bz2", "lz4" or "zstd".
            size: stated unpacked size [bytes]; None = not stated.

        Raises:
            DamageError: damaged, of another size, or too large.
        """
        limit = self._size_limit(len(packed))
        if size is not None and size > limit:
            raise DamageError(
                f"a part of {len(packed)} bytes that states {size} unpacked"
            )
        data = self._unpack(packed, compression, limit if size is None else size)
        if size is not None and len(data) != size:
            raise DamageError(f"a part of {len(data)} bytes that states {size}")
        return data

    def _size_limit(self, packed: int) -> int:
        """Return the limit of the unpacked size of a part of `packed` bytes."""
        if self._ratio is None:
            return self._largest
        return min(self._largest, max(_SMALL, self._ratio * packed))

    def _unpack(self, packed: Packed, compression: str, limit: int) -> bytes:
        try:
            match compression:
                case "" | "none":
                    return _checked(bytes(packed), limit)
                case "bz2":
                    unpacker = bz2.BZ2Decompressor()
                    data = unpacker.decompress(packed, limit + 1)
                    return _checked(data, limit, is_whole=unpacker.eof)
                case "lz4":
                    frame: Any = lz4.frame.LZ4FrameDecompressor()
                    data = frame.decompress(packed, limit + 1)
                    return _checked(data, limit, is_whole=frame.eof)
                case "zstd":
                    return self._unzstd(packed, limit)
                case _:
                    raise DamageError(
                        f"compression {compression[:20]!r}, expected zstd or lz4"
                    )
        except DamageError:
            raise
        except (*_ERRORS, zstandard.ZstdError) as error:
            raise DamageError(f"a packed part that is damaged ({error})") from error

    def _unzstd(self, packed: Packed, limit: int) -> bytes:
        """Unpack a zstd frame, whose own stated size is checked against `limit`."""
        stated = zstandard.frame_content_size(packed)
        if stated > limit:
            raise DamageError(f"a part that would unpack to {stated} bytes")
        return self._zstd.decompress(packed, max_output_size=limit)


def unpack_file(packed: BinaryIO, out: BinaryIO, most: int, window: int) -> None:
    """Unpack a zstd file to `out` piece by piece.

    Args:
        packed: packed file.
        out: output file.
        most: largest unpacked size [bytes].
        window: largest window of the decompressor [bytes].

    Raises:
        DamageError: the file is damaged, or unpacks to more than `most`.
        OSError: a file cannot be read or written.
    """
    unpacker = zstandard.ZstdDecompressor(max_window_size=window)
    written = 0
    try:
        for part in unpacker.read_to_iter(packed):
            written += len(part)
            if written > most:
                raise DamageError(f"content that unpacks to over {most} bytes")
            out.write(part)
    except zstandard.ZstdError as error:
        raise DamageError(f"a packed part that is damaged ({error})") from error


def _checked(data: bytes, limit: int, *, is_whole: bool = True) -> bytes:
    if len(data) > limit:
        raise DamageError(f"a part of more than {limit} bytes unpacked")
    if not is_whole:
        raise DamageError("a packed part that ends too early")
    return data
