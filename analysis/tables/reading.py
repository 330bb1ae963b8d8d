"""A text table as numbers: all rows read exactly, or the file refused with a line."""

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.tables.columns import COLUMNS, GROUPS, PREPARED, SIMULATED, plain
from analysis.tables.dialect import (
    BLANKS,
    Dialect,
    UnfitQuotesError,
    find_dialect,
    is_as_wide,
    numbered_rows,
)
from analysis.tables.encoding import lines_of
from analysis.tables.numbers import MISSING, NumberForm, marks_in
from analysis.tables.refusals import refusal, refused_cell, refused_line
from analysis.tables.times import is_iso, iso_times

Array = NDArray[np.float64]
# Beside these delimiters a comma is a usual decimal mark, and points group thousands.
_CONTINENTAL = (";", "\t")
_DATE = re.compile(r"\d{1,4}[./-]\d{1,2}[./-]\d{2,4}\b|\d{1,2}:\d\d\b")
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
        further: other inputs by name, each of shape (n,); NaN where a value misses.
        groups: words of every row by kind, "trial" or "terrain", that part the table.
    """

    rows: Array
    units: Mapping[str, str]
    is_prepared: bool = False
    is_simulated: bool | None = None
    lines: NDArray[np.intp] | None = None
    notes: tuple[str, ...] = ()
    header: int | None = None
    is_in_seconds: bool = False
    further: Mapping[str, Array] = field(default_factory=dict[str, Array])
    groups: Mapping[str, Sequence[str]] = field(
        default_factory=dict[str, Sequence[str]]
    )

    def place(self, row: int) -> str:
        """Return where a row stands, for people."""
        if self.lines is None:
            return f"row {row + 1}"
        return f"line {self.lines[row]}"


@dataclass(frozen=True, slots=True)
class TextRequest:
    """How a text table is to be read.

    Attributes:
        columns: its name of each column of the analysis, of every further input, and
            of what parts it into trials and terrains.
        rate: rows per second, where it has no time [Hz].
        decimal: "." or ",", where the user says it; then thousands may be grouped.
    """

    columns: Mapping[str, str]
    rate: float | None = None
    decimal: str | None = None

    @property
    def further(self) -> tuple[str, ...]:
        """Inputs beside those of the analysis."""
        return tuple(n for n in self.columns if n not in {*COLUMNS, *GROUPS})

    @property
    def groups(self) -> tuple[str, ...]:
        """What parts the table, of "trial" and "terrain"."""
        return tuple(n for n in GROUPS if n in self.columns)


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
    names = {name: plain(column) for name, column in request.columns.items()}
    marks = {PREPARED: PREPARED, SIMULATED: SIMULATED}
    optional = {PREPARED, SIMULATED} | ({"t"} if request.rate is not None else set())
    head = [plain(line) for line in lines[:256]]
    dialect = find_dialect(path, head, names | marks, optional)
    if request.rate is not None and "t" in dialect.places:
        raise refusal(path, "has a time of its own", "Leave --rate out.")
    count, first = _look(path, lines, dialect)
    if not count:
        raise refusal(path, "a header but no rows", _COPY)
    table = _Cells(path, lines, dialect, request, count)
    numbers = table.numbers(first.get("t", ""))
    return TrialTable(
        np.column_stack([numbers[name] for name in COLUMNS]),
        dialect.units,
        is_prepared=PREPARED in dialect.places,
        is_simulated=table.simulated(),
        lines=np.fromiter((line for line, _ in table), np.intp, count),
        notes=_notes(dialect),
        is_in_seconds=is_iso(first.get("t", "")),
        header=dialect.header_line + 1 if dialect.header_line >= 0 else None,
        further={name: numbers[name] for name in request.further},
        groups={n: list(map(sys.intern, table.column(n))) for n in request.groups},
    )


def _notes(dialect: Dialect) -> tuple[str, ...]:
    if not dialect.skipped:
        return ()
    lines = "1 line" if dialect.skipped == 1 else f"{dialect.skipped} lines"
    return (f"{lines} before the header skipped",)


def _look(
    path: Path, lines: Sequence[str], dialect: Dialect
) -> tuple[int, dict[str, str]]:
    """Return how many rows there are, and the first value of every column."""
    first: dict[str, str] = {}
    count = 0
    for _, row in _body(path, lines, dialect):
        count += 1
        for name, place in dialect.places.items():
            if name in first:
                continue
            cell = plain(row[place]).strip()
            if cell.lower() not in MISSING:
                first.setdefault(name, cell)
    return count, first


def _body(
    path: Path, lines: Sequence[str], dialect: Dialect
) -> Iterator[tuple[int, list[str]]]:
    """Give (line of the file, cells) of every row below the header."""
    width = len(dialect.header)
    try:
        for begin, row in numbered_rows(lines[dialect.first :], dialect.delimiter):
            if not any(row) and len(row) < width:
                continue
            if len(row) != width and not is_as_wide(row, width):
                raise _uneven(path, dialect, row, dialect.first + begin)
            yield dialect.first + begin, row
    except UnfitQuotesError as error:
        raise refused_line(
            path,
            dialect.first + error.line,
            f"its quotes do not fit ({error.reason})",
            "Close the quotes that open on this line.",
        ) from error


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


@dataclass(frozen=True, slots=True)
class _Cells:
    """The cells of a table, cut out of its lines as often as they are asked for.

    A million rows as texts would take ten times what they take as numbers.

    Attributes:
        path: the file.
        lines: of it.
        dialect: its layout.
        request: how it is to be read.
        count: of its rows.
    """

    path: Path
    lines: Sequence[str]
    dialect: Dialect
    request: TextRequest
    count: int

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Give (line of the file, cells) of every row."""
        return _body(self.path, self.lines, self.dialect)

    def column(self, name: str) -> Iterator[str]:
        """Give the cells of a column."""
        place = self.dialect.places[name]
        return (plain(row[place]).strip() for _, row in self)

    def at(self, name: str, row: int) -> tuple[int, str]:
        """Return (line of the file, cell) of a column in a row."""
        line, cells = next(islice(self, row, None))
        return line, plain(cells[self.dialect.places[name]]).strip()

    def numbers(self, first_time: str) -> dict[str, Array]:
        """Return the columns of numbers by name, each of shape (n,).

        Raises:
            SettingsError: a cell is none.
        """
        wanted = (*COLUMNS, *self.request.further)
        names = [name for name in wanted if name in self.dialect.places]
        columns: dict[str, Array] = {}
        if is_iso(first_time):
            columns["t"] = self._dates(first_time)
            names.remove("t")
        elif self.request.rate is not None:
            columns["t"] = np.arange(self.count) / self.request.rate
        form = self._form(names)
        for name in names:
            columns[name], wrong = form.numbers(self.column(name), self.count)
            if wrong is not None:
                line, cell = self.at(name, wrong)
                raise _no_number(self.path, name, cell, line, self.request)
        return columns

    def _dates(self, first: str) -> Array:
        since = iso_times(list(self.column("t")), MISSING)
        if since.wrong is not None:
            line, cell = self.at("t", since.wrong)
            raise refused_cell(
                self.path,
                line,
                self.request.columns["t"],
                cell,
                f"a time like the first one, {first},",
                "Give all times a zone, or none.",
            )
        return since.seconds

    def _form(self, names: Sequence[str]) -> NumberForm:
        """Return how the numbers are written: one decimal mark for the whole file."""
        if self.request.decimal is not None:
            return NumberForm(self.request.decimal, has_groups=True)
        places = [self.dialect.places[name] for name in names]
        by_row = (plain(row[k]).strip() for _, row in self for k in places)
        marks = marks_in(by_row)
        if marks.comma is not None and (marks.point is not None or marks.is_grouped):
            seen = marks.comma if marks.point is None else max(marks.comma, marks.point)
        elif (
            marks.point is not None
            and marks.is_grouped
            and self.dialect.delimiter in _CONTINENTAL
        ):
            seen = marks.point
        else:
            return NumberForm("." if marks.comma is None else ",")
        row, column = divmod(seen, len(names))
        line, cell = self.at(names[column], row)
        both = "points and commas stand in one file"
        alone = "every comma or point stands before three digits"
        known = marks.comma is not None and marks.point is not None
        raise refused_cell(
            self.path,
            line,
            self.request.columns[names[column]],
            cell,
            f"one decimal mark throughout ({both if known else alone}, so that one may "
            "group thousands)",
            "Say which is the decimal mark: --decimal , or --decimal .",
        )

    def simulated(self) -> bool | None:
        """Return what the column `simulated` says of all rows; None without one.

        Raises:
            SettingsError: it does not say the same in all of them.
        """
        if SIMULATED not in self.dialect.places:
            return None
        cells = list(map(sys.intern, self.column(SIMULATED)))
        for row, cell in enumerate(cells):
            if cell not in {"0", "1"} or cell != cells[0]:
                raise refused_cell(
                    self.path,
                    self.at(SIMULATED, row)[0],
                    SIMULATED,
                    cell,
                    "0 in every row, or 1 in every row of a simulated trial,",
                    "Keep simulated and recorded trials in files of their own.",
                )
        return cells[0] == "1"


def _no_number(
    path: Path, name: str, cell: str, line: int, request: TextRequest
) -> Exception:
    """Return why a cell is not read as a number."""
    if name == "t" and _DATE.match(cell):
        expected = "a number or a time as in 2026-11-26T10:00:00.002Z"
        hint = "Give the times so, or leave the column out and give --rate HZ."
    elif request.decimal is not None:
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
