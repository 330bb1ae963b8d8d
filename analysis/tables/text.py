"""Text tables by RFC 4180 with user-defined separator and decimal mark.

By default a table is UTF-8 with commas between columns, decimal points and a header of
`name [unit]`. The layout is not guessed: another separator or decimal mark, or lines to
skip, are options, and what does not fit is refused with line, column, content and the
option that would describe it.
"""

import codecs
import csv
import gzip
import math
import re
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from acquisition.errors import SettingsError
from analysis.tables.columns import (
    COLUMNS,
    GROUPS,
    PREPARED,
    SIMULATED,
    columns_hint,
    find_column,
    place_hint,
    plain,
    split_header,
)
from analysis.tables.refusals import refusal, refused_cell, refused_line
from analysis.tables.times import is_iso, iso_times
from analysis.tables.trial_table import Array, TrialTable

BLANKS = "blanks"  # separator of columns divided by runs of blanks
GZIP = b"\x1f\x8b"
LONGEST_LINE = 65_536  # characters
MOST_LINES = 1_000_000
MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"})
_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf(?:inity)?)",
    re.IGNORECASE,
)
_SEARCHED = 64  # rows below the first that are searched for the column names
_COPY = "Check that it was copied completely."
_OTHER_SEPARATORS = {";": "';'", "\t": "tab"}  # as --sep names them


@dataclass(frozen=True, slots=True)
class TextForm:
    """Layout of a text table as stated by the user.

    Attributes:
        columns: header name of each column of the analysis, each further column, and
            each text column that divides the table into trials and terrains.
        separator: one character between columns, or `BLANKS`.
        decimal: decimal mark, "." or ",".
        skipped: lines of the file to skip, from 1.
        rate: sampling rate of a table without times [Hz].
    """

    columns: Mapping[str, str]
    separator: str = ","
    decimal: str = "."
    skipped: frozenset[int] = frozenset()
    rate: float | None = None

    @property
    def further(self) -> tuple[str, ...]:
        """Further numeric columns."""
        return tuple(n for n in self.columns if n not in {*COLUMNS, *GROUPS})

    @property
    def groups(self) -> tuple[str, ...]:
        """Text columns that divide the table: "trial" and "terrain"."""
        return tuple(n for n in GROUPS if n in self.columns)


def read_text_table(path: Path, form: TextForm, largest: int) -> TrialTable:
    """Read a text table.

    Args:
        path: the file; its size must have been checked.
        form: its layout.
        largest: limit of the size unpacked by gzip [bytes].

    Raises:
        SettingsError: the file does not have this layout.
    """
    rows = _rows(path, _lines(path, largest), form)
    header_line, names = next(rows, (0, []))
    if not names:
        raise refusal(path, "no rows in it", _COPY)
    header = _Header.find(path, header_line, names, form, rows)
    return _read_rows(path, rows, header, form)


@dataclass(frozen=True, slots=True)
class _Header:
    """Names, positions and units of the columns to read.

    Attributes:
        line: line of the file, from 1.
        width: number of columns of the file.
        places: position of every column to read, from 0.
        units: unit by column, if the header states one.
    """

    line: int
    width: int
    places: Mapping[str, int]
    units: Mapping[str, str]

    @classmethod
    def find(
        cls,
        path: Path,
        line: int,
        names: Sequence[str],
        form: TextForm,
        below: Iterator[tuple[int, list[str]]],
    ) -> "_Header":
        """Find the columns of a layout in the first row.

        The rows `below` are searched only to report where the names are instead.

        Raises:
            SettingsError: a column is missing, occurs twice or is used twice.
        """
        names = [plain(name).strip() for name in names]
        needed = {name: plain(column) for name, column in form.columns.items()}
        if form.rate is not None:
            if find_column(names, needed["t"]):
                raise refusal(path, "it has a time column", "Leave --rate out.")
            del needed["t"]
        marks = {PREPARED: PREPARED, SIMULATED: SIMULATED}
        matches = {n: find_column(names, c) for n, c in (needed | marks).items()}
        for name, places in matches.items():
            if len(places) > 1:
                reason = f"column {(needed | marks)[name]} occurs twice"
                raise refused_line(path, line, reason, place_hint(name, places))
        missing = [needed[n] for n in needed if not matches[n]]
        if missing:
            for other, row in islice(below, _SEARCHED):
                cells = [plain(cell).strip() for cell in row]
                if all(find_column(cells, column) for column in needed.values()):
                    raise refused_line(
                        path,
                        line,
                        f"the names of the columns are in line {other}",
                        f"Skip the lines above them: --skip 1-{other - 1}",
                    )
            raise _no_columns(path, line, names, missing, needed, form)
        places = {name: at[0] for name, at in matches.items() if at}
        chosen = [places[name] for name in needed]
        if len(set(chosen)) < len(chosen):
            hint = columns_hint(names, dict.fromkeys(needed, ""))
            raise refused_line(path, line, "one column was named for two", hint)
        units = {
            name: unit
            for name, place in places.items()
            if (unit := split_header(names[place])[1])
        }
        return cls(line, len(names), places, units)


def _no_columns(
    path: Path,
    line: int,
    names: Sequence[str],
    missing: Sequence[str],
    needed: Mapping[str, str],
    form: TextForm,
) -> SettingsError:
    """Make the error for a header that lacks columns, with a suggested option."""
    if len(names) > 1 and all(
        _number(name, form.decimal) is not None for name in names
    ):
        return refused_line(
            path,
            line,
            f"{len(names)} numbers instead of the names of the columns",
            "Put a line of names above them, e.g. t,v_t,F_n,F_t.",
        )
    shown = ", ".join(name for name in names if name)[:300] or "none"
    hint = columns_hint(names, needed)
    other = [sign for sign in _OTHER_SEPARATORS if sign in shown]
    if len(names) == 1 and other:
        hint = f"Another separator: --sep {_OTHER_SEPARATORS[other[0]]}"
    elif len(names) == 1 and len(names[0].split()) > 1:
        hint = f"Blanks between columns: --sep {BLANKS}"
    elif list(missing) == [needed.get("t")]:
        hint += " Rows without a time: --rate HZ."
    reason = f"no column {', '.join(missing)}; it has {shown}"
    return refused_line(path, line, reason, hint)


def _read_rows(
    path: Path, rows: Iterator[tuple[int, list[str]]], header: _Header, form: TextForm
) -> TrialTable:
    numeric = [n for n in (*COLUMNS, *form.further) if n in header.places]
    values = {name: array("d") for name in numeric}
    words: dict[str, list[str]] = {name: [] for name in (*form.groups, "t")}
    marks: dict[str, int] = {}  # first line of each value of `simulated`
    lines = array("q")
    is_dated: bool | None = None  # unknown until the first time
    for line, cells in rows:
        if len(cells) != header.width:
            if not any(cells):
                continue
            raise _uneven(path, line, cells, header)
        lines.append(line)
        for name in form.groups:
            words[name].append(_cell(cells, header.places[name]))
        if SIMULATED in header.places:
            marks.setdefault(_cell(cells, header.places[SIMULATED]), line)
        for name in numeric:
            cell = _cell(cells, header.places[name])
            if name == "t" and is_dated is None and cell.lower() not in MISSING:
                is_dated = is_iso(cell)
            if name == "t" and is_dated:
                words["t"].append(cell)
                continue
            number = _number(cell, form.decimal)
            if number is None:
                raise _no_number(path, line, name, cell, form)
            values[name].append(number)
    if not lines:
        raise refusal(path, "a header but no rows", _COPY)
    columns = {name: np.array(column) for name, column in values.items()}
    numbers = np.array(lines, np.intp)
    if is_dated:
        columns["t"] = _dated(path, numbers, words["t"], form)
    elif form.rate is not None:
        columns["t"] = np.arange(len(lines)) / form.rate
    return TrialTable(
        np.column_stack([columns[name] for name in COLUMNS]),
        header.units,
        is_prepared=PREPARED in header.places,
        is_simulated=_simulated(path, marks),
        lines=numbers,
        is_in_seconds=bool(is_dated),
        header=header.line,
        further={name: columns[name] for name in form.further},
        groups={name: words[name] for name in form.groups},
    )


def _cell(cells: Sequence[str], place: int) -> str:
    return plain(cells[place]).strip()


def _number(cell: str, decimal: str) -> float | None:
    """Parse a cell; NaN for a missing value, None if it is not a number."""
    if cell.lower() in MISSING:
        return math.nan
    if decimal == ",":
        cell = "?" if "." in cell else cell.replace(",", ".", 1)
    return float(cell) if _NUMBER.fullmatch(cell) else None


def _no_number(
    path: Path, line: int, name: str, cell: str, form: TextForm
) -> SettingsError:
    other = "," if form.decimal == "." else "."
    expected = f"a number with decimal mark {form.decimal!r}"
    if other in cell and any(sign.isdigit() for sign in cell):
        hint = (
            f"Decimal marks {other!r}: --decimal {other}. Thousands separators are not "
            "read: save the numbers without them."
        )
    elif name == "t":
        expected += " or a time as in 2026-11-26T10:00:00.002Z"
        hint = "Give the times so, or leave the column out and give --rate HZ."
    else:
        hint = (
            "Leave the cell empty if there is no value: its row is dropped and "
            f"counted. A line that is not a row: --skip {line}."
        )
    return refused_cell(path, line, form.columns[name], cell, expected, hint)


def _uneven(
    path: Path, line: int, cells: Sequence[str], header: _Header
) -> SettingsError:
    reason = f"{len(cells)} cells below {header.width} names"
    if len(cells) < header.width:
        hint = "Complete or remove the line; the last line may be cut off."
    else:
        hint = (
            "Give every column a name. A cell that holds the separator, as a decimal "
            "comma between commas does, needs quotes."
        )
    return refused_line(path, line, reason, hint)


def _dated(
    path: Path, lines: np.ndarray, cells: Sequence[str], form: TextForm
) -> Array:
    since = iso_times(cells, MISSING)
    if since.wrong is not None:
        raise refused_cell(
            path,
            int(lines[since.wrong]),
            form.columns["t"],
            cells[since.wrong],
            f"a time like the first one, {cells[0]},",
            "Give all times a zone, or none.",
        )
    return since.seconds


def _simulated(path: Path, marks: Mapping[str, int]) -> bool | None:
    """Return the value of the column `simulated`; None without one.

    Raises:
        SettingsError: the value differs between rows.
    """
    if not marks:
        return None
    for k, (cell, line) in enumerate(marks.items()):
        if k or cell not in {"0", "1"}:
            raise refused_cell(
                path,
                line,
                SIMULATED,
                cell,
                "0 in every row, or 1 in every row of a simulated trial,",
                "Keep simulated and recorded trials in separate files.",
            )
    return "1" in marks


def _rows(
    path: Path, lines: Sequence[str], form: TextForm
) -> Iterator[tuple[int, list[str]]]:
    """Yield (first line, cells) of every non-empty row.

    Raises:
        SettingsError: quotes are not closed.
    """
    if beyond := [number for number in form.skipped if number > len(lines)]:
        raise refusal(
            path, f"--skip {beyond[0]}, and it has {len(lines)} lines", "Leave it out."
        )
    kept = [k for k in range(len(lines)) if k + 1 not in form.skipped]
    texts = [lines[k] for k in kept]
    if form.separator == BLANKS:
        texts = [" ".join(text.split()) for text in texts]
    if texts and texts[0].startswith("#"):
        texts[0] = texts[0].lstrip("# ")  # header as written by numpy.savetxt
    reader = csv.reader(
        texts,
        delimiter=" " if form.separator == BLANKS else form.separator,
        skipinitialspace=form.separator != BLANKS,
        strict=True,
    )
    begin = 0
    while True:
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise refused_line(
                path,
                kept[min(begin, len(kept) - 1)] + 1,
                f"its quotes do not fit ({error})",
                "Close the quotes that open on this line.",
            ) from error
        if row:
            yield kept[begin] + 1, row
        begin = reader.line_num


def _lines(path: Path, largest: int) -> list[str]:
    """Return the lines of a text file, plain or packed by gzip.

    Raises:
        SettingsError: the file is not text, or a line or their number exceeds a limit.
    """
    text = _decoded(path, _content(path, largest)).rstrip("\x1a")  # end-of-file mark
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if (count := text.count("\n")) > MOST_LINES:
        hint = "Give one table per trial."
        raise refusal(path, f"{count} lines, the limit is {MOST_LINES}", hint)
    lines = text.removesuffix("\n").split("\n")
    for number, line in enumerate(lines, 1):
        if len(line) + 1 >= LONGEST_LINE:  # including the line end
            reason = f"a line exceeds {LONGEST_LINE} characters"
            hint = "Give a table with a row per line."
            raise refused_line(path, number, reason, hint)
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
    """Decode UTF-8, or UTF-16 with a byte-order mark."""
    is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    encoding = "utf-16" if is_wide else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        before = content[: error.start].decode(encoding, errors="replace")
        shown = "UTF-16" if is_wide else "UTF-8"
        raise refused_line(
            path,
            before.count("\n") + 1,
            f"byte 0x{content[error.start]:02x} is not {shown}",
            f"Save it as UTF-8, e.g. iconv -f ENCODING -t UTF-8 '{path}'",
        ) from error
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        reason = "a zero byte; this is not UTF-8 text"
        raise refused_line(path, line, reason, "Give CSV, Parquet or npz tables.")
    return text
