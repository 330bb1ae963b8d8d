"""The checksums of data section and summary, which no mcap reader compares."""

import struct
import zlib
from pathlib import Path
from typing import IO

from acquisition.errors import TrialFileError

MAGIC = b"\x89MCAP0\r\n"
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary, summary offsets, crc
_DATA_END = struct.Struct("<BQI")  # opcode, length, crc
_FOOTER_OPCODE = 2
_DATA_END_OPCODE = 15
_BLOCK_BYTES = 1 << 20


def check_checksums(file: IO[bytes], size: int, path: Path) -> None:
    """Hold both sections of an MCAP file of `size` bytes against their CRC-32.

    The data section is all up to its end record, which stands right before the
    summary; the summary reaches to the checksum in the footer. Only these two notice
    a damaged attachment or metadata record.

    Raises:
        TrialFileError: a checksum is wrong, missing, or not where it should be.
    """
    footer_at = size - len(MAGIC) - _FOOTER.size
    opcode, _, summary_at, _, summary_crc = _read(file, footer_at, _FOOTER, path)
    end_at = summary_at - _DATA_END.size
    if opcode != _FOOTER_OPCODE or not len(MAGIC) <= end_at < footer_at:
        raise TrialFileError(path, "has no footer where it should be")
    opcode, _, data_crc = _read(file, end_at, _DATA_END, path)
    if opcode != _DATA_END_OPCODE:
        raise TrialFileError(path, "has no end of data where it should be")
    if _crc(file, summary_at, footer_at + _FOOTER.size - 4) != summary_crc:
        raise TrialFileError(path, "has a summary whose checksum is wrong")
    if _crc(file, 0, end_at) != data_crc:
        raise TrialFileError(path, "has data whose checksum is wrong")


def _read(
    file: IO[bytes], offset: int, form: struct.Struct, path: Path
) -> tuple[int, ...]:
    if offset < 0:
        raise TrialFileError(path, "is too short for a trial file")
    file.seek(offset)
    return form.unpack(file.read(form.size))


def _crc(file: IO[bytes], start: int, end: int) -> int:
    file.seek(start)
    crc, left = 0, end - start
    while left > 0:
        block = file.read(min(left, _BLOCK_BYTES))
        if not block:
            break
        crc = zlib.crc32(block, crc)
        left -= len(block)
    return crc
