"""A text table as numbers: all rows read exactly, or the file refused with a line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.dialects.columns import COLUMNS, PREPARED, SIMULATED, plain
from analysis.dialects.dialect import (
    BLANKS,
    Dialect,
    UnfitQuotesError,
    find_dialect,
    is_as_wide,
    numbered_rows,
)
from analysis.dialects.encoding import lines_of
from analysis.dialects.numbers import MISSING, NumberForm, marks_in
from analysis.dialects.refusals import refusal, refused_cell, refused_line
from analysis.dialects.times import is_iso, iso_times

Array = NDArray[np.float64]
MOST_ROWS = 500_000  # of a table; 17 minutes at 500 Hz
# Beside these delimiters a comma is a usual decimal mark, and points group thousands.
_CONTINENTAL = (";", "\t")
_COPY = "Check that it was copied completely."


@dataclass(frozen=True, slots=True)
class TrialTable:
    """The rows of a table, in its own units.

    Attributes:
        rows: t, v_t, F_n and F_t, shape (n, 4); NaN where a value misses.
        units: unit by column, where the table states one.
        is_prepared: the rows are samples kept by an earlier preparation.
        is_simulated: the table says in every row that the devices were simulated; None
            where it says nothing.
        lines: line of the file of every row, shape (n,); None where it has no lines.
        notes: what had to be decided to read it, for people.
        header: line of the file with the names; None where it has none.
        is_in_seconds: times are seconds by the form of the file.
    """

    rows: Array
    units: Mapping[str, str]
    is_prepared: bool = False
    is_simulated: bool | None = None
    lines: NDArray[np.intp] | None = None
    notes: tuple[str, ...] = ()
    header: int | None = None
    is_in_seconds: bool = False

    def place(self, row: int) -> str:
        """Return where a row stands, for people."""
        if self.lines is None:
            return f"row {row + 1}"
        return f"line {self.lines[row]}"


@dataclass(frozen=True, slots=True)
class TextRequest:
    """How a text table is to be read.

    Attributes:
        columns: its name of each column of the analysis.
        rate: rows per second, where it has no time [Hz].
        decimal: "." or ",", where the user says it; then thousands may be grouped.
    """

    columns: Mapping[str, str]
    rate: float | None = None
    decimal: str | None = None


def read_text_table(path: Path, request: TextRequest, largest: int) -> TrialTable:
    """Return the rows of a text table.

    Args:
        path: the file; the caller has checked its size.
        request: how it is to be read.
        largest: bytes that it may unpack to, where gzip packed it.

    Raises:
        SettingsError: it is no such table, or its time is not that of `rate`.
    """
    lines = lines_of(path, largest)
    names = {name: plain(request.columns[name]) for name in COLUMNS}
    marks = {PREPARED: PREPARED, SIMULATED: SIMULATED}
    optional = {PREPARED, SIMULATED} | ({"t"} if request.rate is not None else set())
    head = [plain(line) for line in lines[:256]]
    dialect = find_dialect(path, head, names | marks, optional)
    if request.rate is not None and "t" in dialect.places:
        raise refusal(path, "has a time of its own", "Leave --rate out.")
    cells, numbers = _columns(path, lines, dialect)
    if not numbers:
        raise refusal(path, "a header but no rows", _COPY)
    rows = _rows(path, cells, numbers, dialect, request)
    notes = _notes(dialect)
    return TrialTable(
        rows,
        dialect.units,
        is_prepared=PREPARED in dialect.places,
        is_simulated=_simulated(path, cells.get(SIMULATED), numbers),
        lines=np.array(numbers, dtype=np.intp),
        notes=notes,
        is_in_seconds=is_iso(_first(cells.get("t", ()))),
        header=dialect.header_line + 1 if dialect.header_line >= 0 else None,
    )


def _notes(dialect: Dialect) -> tuple[str, ...]:
    if not dialect.skipped:
        return ()
    lines = "1 line" if dialect.skipped == 1 else f"{dialect.skipped} lines"
    return (f"{lines} before the header skipped",)


def _columns(
    path: Path, lines: Sequence[str], dialect: Dialect
) -> tuple[dict[str, list[str]], list[int]]:
    """Return the cells of the columns that were found, and the line of every row."""
    cells: dict[str, list[str]] = {name: [] for name in dialect.places}
    taken = [(cells[name].append, place) for name, place in dialect.places.items()]
    numbers: list[int] = []
    width = len(dialect.header)
    body = lines[dialect.first :]
    try:
        for begin, row in numbered_rows(body, dialect.delimiter):
            if not any(row) and len(row) < width:
                continue
            if len(row) != width and not is_as_wide(row, width):
                raise _uneven(path, dialect, row, dialect.first + begin)
            for append, place in taken:
                append(plain(row[place]).strip())
            numbers.append(dialect.first + begin)
    except UnfitQuotesError as error:
        raise refused_line(
            path,
            dialect.first + error.line,
            f"its quotes do not fit ({error.reason})",
            "Close the quotes that open on this line.",
        ) from error
    if len(numbers) > MOST_ROWS:
        reason = f"{len(numbers)} rows, the limit is {MOST_ROWS}"
        raise refusal(path, reason, "Give one table per trial.")
    return cells, numbers


def _uneven(path: Path, dialect: Dialect, row: Sequence[str], line: int) -> Exception:
    """Return why a row has another number of cells than the header."""
    width = len(dialect.header)
    names = f"{len(row)} cells below {width} names"
    if dialect.delimiter == "," and len(row) % width == 0:
        return refused_line(
            path,
            line,
            f"{names}: commas stand between the columns and inside the numbers",
            "Export it with decimal points, or with semicolons between the columns.",
        )
    if len(row) < width:
        hint = "Complete the line or take it out; a last one may be cut off."
    elif dialect.delimiter == BLANKS:
        hint = "A name or number with a blank: put it into quotes."
    else:
        hint = "Give every column a name, or put numbers with groups into quotes."
    return refused_line(path, line, names, hint)


def _rows(
    path: Path,
    cells: Mapping[str, Sequence[str]],
    lines: Sequence[int],
    dialect: Dialect,
    request: TextRequest,
) -> Array:
    """Return the four columns as numbers, shape (n, 4)."""
    columns: dict[str, Array] = {}
    wanted = [name for name in COLUMNS if name in cells]
    times = cells.get("t", ())
    first = _first(times)
    if is_iso(first):
        since = iso_times(times, MISSING)
        if since.wrong is not None:
            raise refused_cell(
                path,
                lines[since.wrong],
                request.columns["t"],
                times[since.wrong],
                f"a time like the first one, {first},",
                "Give all times a zone, or none.",
            )
        columns["t"] = since.seconds
        wanted.remove("t")
    texts = {name: cells[name] for name in wanted}
    form = _form(path, texts, lines, dialect, request)
    for name in wanted:
        columns[name], wrong = form.numbers(cells[name])
        if wrong is not None:
            raise _no_number(path, name, cells[name][wrong], lines[wrong], request)
    if request.rate is not None:
        columns["t"] = np.arange(len(lines)) / request.rate
    return np.column_stack([columns[name] for name in COLUMNS])


def _first(cells: Sequence[str]) -> str:
    """Return the first cell with a value; "" without one."""
    return next((cell for cell in cells if cell.lower() not in MISSING), "")


def _form(
    path: Path,
    texts: Mapping[str, Sequence[str]],
    lines: Sequence[int],
    dialect: Dialect,
    request: TextRequest,
) -> NumberForm:
    """Return how the numbers are written: one decimal mark for the whole file."""
    if request.decimal is not None:
        return NumberForm(request.decimal, has_groups=True)
    names = list(texts)
    by_row = (cell for row in zip(*texts.values(), strict=True) for cell in row)
    marks = marks_in(by_row)
    if marks.comma is not None and (marks.point is not None or marks.is_grouped):
        seen = marks.comma if marks.point is None else max(marks.comma, marks.point)
    elif (
        marks.point is not None
        and marks.is_grouped
        and dialect.delimiter in _CONTINENTAL
    ):
        seen = marks.point
    else:
        return NumberForm("." if marks.comma is None else ",")
    row, column = divmod(seen, len(names))
    name = names[column]
    both = "points and commas stand in one file"
    alone = "every comma or point stands before three digits"
    known = marks.comma is not None and marks.point is not None
    raise refused_cell(
        path,
        lines[row],
        request.columns[name],
        texts[name][row],
        f"one decimal mark throughout ({both if known else alone}, so that one may "
        "group thousands)",
        "Say which is the decimal mark: --decimal , or --decimal .",
    )


def _no_number(
    path: Path, name: str, cell: str, line: int, request: TextRequest
) -> Exception:
    """Return why a cell is not read as a number."""
    if request.decimal is not None:
        expected = f"a number with the decimal mark {request.decimal!r}"
        hint = "Leave --decimal out, or mend the number."
    elif any(sign.isdigit() for sign in cell) and not any(map(str.isalpha, cell)):
        expected = "a number without groups of thousands"
        hint = "Say which is the decimal mark: --decimal . or --decimal ,"
    elif name == "t":
        expected = "a number or a time as in 2026-11-26T10:00:00.002Z"
        hint = "Give the times so, or leave the column out and give --rate HZ."
    else:
        expected = "a number"
        hint = (
            "Leave the cell empty where there is no value: its row is dropped and "
            "counted."
        )
    return refused_cell(path, line, request.columns[name], cell, expected, hint)


def _simulated(
    path: Path, cells: Sequence[str] | None, lines: Sequence[int]
) -> bool | None:
    """Return what the column `simulated` says of all rows; None without one."""
    if cells is None:
        return None
    for cell, line in zip(cells, lines, strict=True):
        if cell not in {"0", "1"} or cell != cells[0]:
            raise refused_cell(
                path,
                line,
                SIMULATED,
                cell,
                "0 in every row, or 1 in every row of a simulated trial,",
                "Keep simulated and recorded trials in files of their own.",
            )
    return cells[0] == "1"
