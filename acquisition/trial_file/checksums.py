"""Checksums of data section and summary, which the mcap library does not verify."""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from acquisition.errors import TrialFileError
from acquisition.trial_file.records import MAGIC

_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary, summary offsets, crc
_DATA_END = struct.Struct("<BQI")  # opcode, length, crc


@dataclass(frozen=True, slots=True)
class Sections:
    """Offsets of the sections of an MCAP file.

    Attributes:
        data_end: record that ends the data section.
        summary: summary, directly after that record.
        footer: footer, directly after the summary.
    """

    data_end: int
    summary: int
    footer: int


def check_sections(data: bytes, path: Path) -> Sections:
    """Verify the CRC-32 of both sections of an MCAP file.

    The data section extends to its end record, directly before the summary; the summary
    to the checksum in the footer. Only these two detect a damaged metadata record.

    Raises:
        TrialFileError: a magic or checksum is wrong, missing or misplaced.
    """
    _check_magic(data, path)
    footer = len(data) - len(MAGIC) - _FOOTER.size
    if footer < 0:
        raise TrialFileError(path, "is too short for a trial file")
    opcode, _, summary, _, summary_crc = _FOOTER.unpack_from(data, footer)
    end = summary - _DATA_END.size
    if opcode != Opcode.FOOTER or not len(MAGIC) <= end <= footer - _DATA_END.size:
        raise TrialFileError(path, "has no footer where it should be")
    opcode, _, data_crc = _DATA_END.unpack_from(data, end)
    if opcode != Opcode.DATA_END:
        raise TrialFileError(path, "has no end of data where it should be")
    whole = memoryview(data)
    actual = zlib.crc32(whole[summary : footer + _FOOTER.size - 4])
    _check_sum("a summary", actual, summary_crc, path)
    _check_sum("data", zlib.crc32(whole[:end]), data_crc, path)
    return Sections(end, summary, footer)


def _check_sum(part: str, actual: int, stated: int, path: Path) -> None:
    """Refuse a section with a wrong or missing (0) checksum."""
    if actual == stated:
        return
    if stated:
        raise TrialFileError(path, f"has {part} whose checksum is wrong")
    raise TrialFileError(
        path,
        f"has {part} without a checksum: another program wrote it, and nothing shows "
        "whether it is whole",
        hint=f"Copy what is sound: traction recover {path}",
    )


def _check_magic(data: bytes, path: Path) -> None:
    if len(data) < 2 * len(MAGIC) or not data.startswith(MAGIC):
        raise TrialFileError(path, "is no MCAP file")
    if not data.endswith(MAGIC):
        raise TrialFileError(
            path,
            "is cut off: it does not end as an MCAP file does",
            hint=f"Salvage it: traction recover {path}",
        )
