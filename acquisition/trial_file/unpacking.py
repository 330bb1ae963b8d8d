"""Packed parts of a file, unpacked within bounds: a bomb is refused, not unpacked."""

import bz2
from typing import Any, BinaryIO

import lz4.frame  # pyright: ignore[reportMissingTypeStubs]
import zstandard

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_SMALL = 2**20  # bytes that any part may unpack to, whatever its ratio
_ERRORS = (OSError, EOFError, RuntimeError, ValueError, MemoryError)
Packed = bytes | memoryview


class DamageError(ValueError):
    """Stored data are damaged or too large; the text names them, as a noun phrase."""


class Unpacker:
    """Unpacks the parts of one file; not for two threads at once."""

    def __init__(self, largest: int, ratio: int | None = None) -> None:
        """Set the bounds.

        Args:
            largest: bytes that a part may unpack to.
            ratio: of a part unpacked to the same part packed, at most; None = any. A
                part may have 1 MiB whatever its ratio.
        """
        self._largest = largest
        self._ratio = ratio
        self._zstd = zstandard.ZstdDecompressor(max_window_size=largest)

    def unpack(
        self, packed: Packed, compression: str, size: int | None = None
    ) -> bytes:
        """Return what a part unpacks to; never more than the bounds, nor than `size`.

        Args:
            packed: as it is stored.
            compression: "" or "none", "bz2", "lz4" or "zstd".
            size: bytes that it is said to unpack to; None = not said.

        Raises:
            DamageError: it is damaged, of another size, or unpacks to too much.
        """
        most = self._room(len(packed))
        if size is not None and size > most:
            raise DamageError(
                f"a part of {len(packed)} bytes that states {size} unpacked"
            )
        data = self._unpack(packed, compression, most if size is None else size)
        if size is not None and len(data) != size:
            raise DamageError(f"a part of {len(data)} bytes that states {size}")
        return data

    def _room(self, packed: int) -> int:
        """Return how many bytes a part of `packed` bytes may unpack to."""
        if self._ratio is None:
            return self._largest
        return min(self._largest, max(_SMALL, self._ratio * packed))

    def _unpack(self, packed: Packed, compression: str, most: int) -> bytes:
        try:
            match compression:
                case "" | "none":
                    return _checked(bytes(packed), most)
                case "bz2":
                    unpacker = bz2.BZ2Decompressor()
                    data = unpacker.decompress(packed, most + 1)
                    return _checked(data, most, is_whole=unpacker.eof)
                case "lz4":
                    frame: Any = lz4.frame.LZ4FrameDecompressor()
                    data = frame.decompress(packed, most + 1)
                    return _checked(data, most, is_whole=frame.eof)
                case "zstd":
                    return self._unzstd(packed, most)
                case _:
                    raise DamageError(
                        f"compression {compression[:20]!r}, expected zstd or lz4"
                    )
        except DamageError:
            raise
        except (*_ERRORS, zstandard.ZstdError) as error:
            raise DamageError(f"a packed part that is damaged ({error})") from error

    def _unzstd(self, packed: Packed, most: int) -> bytes:
        """Unpack a zstd frame; what it states itself is as much a claim as `most`."""
        stated = zstandard.frame_content_size(packed)
        if stated > most:
            raise DamageError(f"a part that would unpack to {stated} bytes")
        return self._zstd.decompress(packed, max_output_size=most)


def unpack_file(packed: BinaryIO, out: BinaryIO, most: int, window: int) -> None:
    """Write what a file packed by zstd holds into `out`, a piece at a time.

    Args:
        packed: the file.
        out: what is written to.
        most: bytes that it may unpack to.
        window: bytes that the unpacker may keep.

    Raises:
        DamageError: it is damaged, or unpacks to more than `most`.
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


def _checked(data: bytes, most: int, *, is_whole: bool = True) -> bytes:
    if len(data) > most:
        raise DamageError(f"a part of more than {most} bytes unpacked")
    if not is_whole:
        raise DamageError("a packed part that ends too early")
    return data
