"""From the bytes of a file to its lines: byte-order mark, UTF-8, UTF-16, line ends."""

import codecs
import gzip
import zlib
from pathlib import Path

from analysis.tables.refusals import refusal, refused_line

GZIP = b"\x1f\x8b"
LONGEST_LINE = 65_536  # characters
MOST_LINES = 1_000_000
_PROBED = 1000  # bytes in which zeros tell UTF-16 from UTF-8
_END_OF_FILE = "\x1a"  # old programs end a text with it
_COPY = "Check that it was copied completely."


def lines_of(path: Path, largest: int) -> list[str]:
    """Return the lines of a text file, or of one that gzip packed.

    Args:
        path: the file; the caller has checked its size.
        largest: bytes that it may unpack to.

    Raises:
        SettingsError: it is no text, or a line or their number is out of bounds.
    """
    text = _decoded(path, _content(path, largest)).rstrip(_END_OF_FILE)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if (count := text.count("\n")) > MOST_LINES:
        hint = "Give one table per trial."
        raise refusal(path, f"{count} lines, the limit is {MOST_LINES}", hint)
    lines = text.split("\n")
    longest = max(range(len(lines)), key=lambda k: len(lines[k]))
    if len(lines[longest]) + 1 >= LONGEST_LINE:  # with its end
        reason = f"a line exceeds {LONGEST_LINE} characters"
        hint = "Give a table with a row per line."
        raise refused_line(path, longest + 1, reason, hint)
    return lines


def _content(path: Path, largest: int) -> bytes:
    content = path.read_bytes()
    if not content.startswith(GZIP):
        return content
    try:
        with gzip.open(path) as file:
            content = file.read(largest + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise refusal(path, f"gzip cannot unpack it ({error})", _COPY) from error
    if len(content) > largest:
        reason = f"unpacks to more than {largest / 1e6:.0f} MB"
        raise refusal(path, reason, "Split it into one file per trial.")
    return content


def _decoded(path: Path, content: bytes) -> str:
    encoding = _encoding(path, content)
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        before = content[: error.start].decode(encoding, errors="replace")
        line = before.count("\n") + 1
        if encoding == "utf-16" and len(content) % 2:
            reason = "the file ends in the middle of a character of UTF-16"
            raise refused_line(path, line, reason, _COPY) from error
        reason = f"byte 0x{content[error.start]:02x} is not {encoding[:6].upper()}"
        raise refused_line(path, line, reason, _converted("WINDOWS-1252", path)) from (
            error
        )
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        reason = "a zero byte; this is no text table"
        raise refused_line(path, line, reason, "Give CSV, Parquet or npz tables.")
    return text


def _encoding(path: Path, content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        raise refused_line(
            path, 1, "this is UTF-32, UTF-8 was expected", _converted("UTF-32", path)
        )
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if content.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    start = content[:_PROBED]
    for odd, name in ((1, "UTF-16LE"), (0, "UTF-16BE")):
        if len(start) > 8 and not any(start[odd::2]) and all(start[1 - odd :: 2]):
            reason = f"this is {name} without a byte-order mark, UTF-8 was expected"
            raise refused_line(path, 1, reason, _converted(name, path))
    return "utf-8"


def _converted(encoding: str, path: Path) -> str:
    return (
        f"Save it as UTF-8, e.g. iconv -f {encoding} -t UTF-8 '{path}' > "
        f"'{path.stem}-utf8.csv'"
    )
