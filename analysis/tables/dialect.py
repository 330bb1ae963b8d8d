"""How a text table is laid out: lines before the header, delimiter, header, units."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from acquisition.errors import SettingsError
from analysis.tables.columns import (
    COLUMNS,
    columns_hint,
    find_column,
    place_hint,
    split_header,
    unit_of_cell,
)
from analysis.tables.numbers import MARKS, NumberForm
from analysis.tables.refusals import refusal, refused_line
from analysis.tables.times import is_iso

BLANKS = " "  # the delimiter of columns that runs of blanks part
_DELIMITERS = ("\t", ";", ",", BLANKS)  # the first one that fits is taken
_COMMENTS = ("#", "%", "//", ";")
_SEPARATOR = "sep="
_BLANK = 3  # empty lines between a header and its units
_SEARCHED = 64  # lines for the header
_COMPARED = 20  # rows whose cells are counted
_FEWEST = 3  # cells of a table without a time


class UnfitQuotesError(Exception):
    """Quotes of a row do not fit; it begins on this line, the first one is 1."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(f"line {line}: {reason}")
        self.line = line
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Dialect:
    """The layout of a text table.

    Attributes:
        delimiter: of the cells; " " for runs of blanks.
        header: its names; "" for each column where there is none.
        header_line: index of the header among the lines; -1 where there is none.
        first: index of the first row among the lines.
        places: of every column that was found, from 0.
        units: that the header or the row of units states, by column.
        skipped: lines before the header that are no part of the table.
    """

    delimiter: str
    header: Sequence[str]
    header_line: int
    first: int
    places: Mapping[str, int]
    units: Mapping[str, str]
    skipped: int


def numbered_rows(
    lines: Sequence[str], delimiter: str
) -> Iterator[tuple[int, list[str]]]:
    """Give (line on which it begins, cells) of every row; the first line is 1.

    Raises:
        UnfitQuotesError: quotes do not fit.
    """
    if delimiter == BLANKS:
        tidy = (" ".join(line.split()) for line in lines)
        reader = csv.reader(tidy, delimiter=BLANKS, strict=True)
    else:
        reader = csv.reader(
            lines, delimiter=delimiter, skipinitialspace=True, strict=True
        )
    line = 0
    while True:
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise UnfitQuotesError(line + 1, str(error)) from error
        yield line + 1, row
        line = reader.line_num


def find_dialect(
    path: Path, lines: Sequence[str], columns: Mapping[str, str], optional: set[str]
) -> Dialect:
    """Return the layout of a table.

    Args:
        path: of the file, for refusals.
        lines: of the file.
        columns: name of each column that is looked for in the table.
        optional: those of `columns` that may be missing.

    Raises:
        SettingsError: there is no header, it lacks a column, or one stands there twice.
    """
    start, delimiters = _separator(lines)
    needed = {name: c for name, c in columns.items() if name not in optional}
    if all(column.isdecimal() for column in needed.values()):
        found = _by_place(lines, start, delimiters, needed)
    else:
        found = _by_name(lines, start, delimiters, needed)
    if found is None:
        raise _no_header(path, lines, start, delimiters, needed)
    delimiter, header_line, header, first = found
    places = _places(path, header_line, header, columns, needed)
    units = {
        name: unit
        for name, place in places.items()
        if name in COLUMNS and (unit := split_header(header[place])[1])
    }
    row = first
    while row < min(len(lines), first + _BLANK) and not lines[row].strip():
        row += 1
    below = _units_row(path, lines, row, delimiter, places, units)
    if below is not None:
        first, units = row + 1, {**units, **below}
    skipped = sum(bool(line.strip()) for line in lines[start : max(header_line, start)])
    return Dialect(delimiter, header, header_line, first, places, units, skipped)


def _separator(lines: Sequence[str]) -> tuple[int, Sequence[str]]:
    """Return (index of the first line of the table, delimiters that it may have)."""
    first = lines[0].strip('" ') if lines else ""
    if first[: len(_SEPARATOR)].lower() == _SEPARATOR:
        given = first[len(_SEPARATOR) :]
        return 1, (given[0],) if given else ("\t",)
    return 0, _DELIMITERS


_Found = tuple[str, int, list[str], int]  # delimiter, header's line, header, first row


def _by_name(
    lines: Sequence[str],
    start: int,
    delimiters: Sequence[str],
    needed: Mapping[str, str],
) -> _Found | None:
    """Return the first line that has all names under one delimiter."""
    for k in range(start, min(len(lines), start + _SEARCHED)):
        found: list[_Found] = []
        for delimiter in delimiters:
            for text in dict.fromkeys((lines[k], _uncommented(lines[k]))):
                header = _header_cells(text, delimiter)
                if all(find_column(header, column) for column in needed.values()):
                    found.append((delimiter, k, header, k + 1))
        if found:
            fits = (f for f in found if _has_width(lines, f[3], f[0], len(f[2])))
            return next(fits, found[0])
    return None


def _by_place(
    lines: Sequence[str],
    start: int,
    delimiters: Sequence[str],
    needed: Mapping[str, str],
) -> _Found | None:
    """Return the first line with numbers at all the places."""
    places = [int(column) - 1 for column in needed.values()]
    for k in range(start, min(len(lines), start + _SEARCHED)):
        for delimiter in delimiters:
            cells = _cells(lines[k], delimiter)
            if max(places) >= len(cells) or min(places) < 0:
                continue
            if not all(_is_value(cells[place]) for place in places):
                continue
            if not _has_width(lines, k, delimiter, len(cells)):
                continue
            return _with_header_above(lines, start, k, delimiter, len(cells))
    return None


def _with_header_above(
    lines: Sequence[str], start: int, first: int, delimiter: str, width: int
) -> _Found:
    """Return the layout with the header, and its row of units, above the first row."""
    above = [k for k in range(start, first) if lines[k].strip()]
    header_line, header = -1, [""] * width
    row = first
    for k in reversed(above[-2:]):
        cells = _header_cells(_uncommented(lines[k]), delimiter)
        if len(cells) != width:
            break
        if header_line >= 0 and None in map(unit_of_cell, header):
            break  # the line below it is the header itself
        row = k + 1
        header_line, header = k, cells
    if header_line < 0:
        return delimiter, first - 1 if above else -1, header, first
    return delimiter, header_line, header, row


def _places(
    path: Path,
    line: int,
    header: Sequence[str],
    columns: Mapping[str, str],
    needed: Mapping[str, str],
) -> dict[str, int]:
    found = {name: find_column(header, column) for name, column in columns.items()}
    _refuse_twice(path, line, columns, found)
    places = {name: at[0] for name, at in found.items() if at}
    chosen = [places[name] for name in needed]
    if len(set(chosen)) < len(chosen):
        raise refused_line(
            path,
            line + 1,
            "one column was named for two",
            columns_hint(header, dict.fromkeys(needed, "")),
        )
    return places


def _refuse_twice(
    path: Path,
    line: int,
    columns: Mapping[str, str],
    found: Mapping[str, Sequence[int]],
) -> None:
    """Refuse a header in which a name stands twice."""
    for name, at in found.items():
        if len(at) > 1:
            raise refused_line(
                path,
                line + 1,
                f"column {columns[name]} occurs twice",
                place_hint(name, at),
            )


def _units_row(
    path: Path,
    lines: Sequence[str],
    first: int,
    delimiter: str,
    places: Mapping[str, int],
    stated: Mapping[str, str],
) -> dict[str, str] | None:
    """Return the units that the line below the header states; None where it does not.

    Raises:
        SettingsError: it contradicts the header.
    """
    cells = _header_cells(lines[first], delimiter) if first < len(lines) else []
    wanted = {name: place for name, place in places.items() if name in COLUMNS}
    if len(cells) <= max(wanted.values(), default=0):
        return None
    if any(_is_value(cell) for cell in cells if cell.strip("-")):
        return None
    units = {name: unit_of_cell(cells[place]) for name, place in wanted.items()}
    if None in units.values() or not any(units.values()):
        return None
    for name, unit in units.items():
        if unit and stated.get(name, unit) != unit:
            raise refused_line(
                path,
                first + 1,
                f"{name} is in {unit} here and in {stated[name]} in the header above",
                "Leave one of the two out of the file.",
            )
    return {
        name: unit for name, unit in units.items() if unit and unit not in {"-", "1"}
    }


def _no_header(
    path: Path,
    lines: Sequence[str],
    start: int,
    delimiters: Sequence[str],
    needed: Mapping[str, str],
) -> SettingsError:
    """Return why the lines are no table with these columns."""
    filled = [
        k for k in range(start, min(len(lines), start + _SEARCHED)) if lines[k].strip()
    ]
    widest = max(
        ((k, d) for k in filled for d in delimiters),
        key=lambda kd: (_score(lines, *kd, needed), -kd[0]),
        default=None,
    )
    if widest is None:
        return refusal(path, "no rows in it", "Check that it was copied completely.")
    line, delimiter = widest
    header = _header_cells(_uncommented(lines[line]), delimiter)
    if len(header) >= _FEWEST and all(_is_value(cell) for cell in header if cell):
        return refused_line(
            path,
            line + 1,
            f"{len(header)} numbers stand where the names of the columns were expected",
            _place_hint(len(header)),
        )
    found = {name: find_column(header, column) for name, column in needed.items()}
    _refuse_twice(path, line, needed, found)
    missing = [needed[name] for name, at in found.items() if not at]
    hint = columns_hint(header, needed)
    if missing == [needed.get("t")]:
        hint += " Rows without a time: --rate HZ."
    known, is_even, _ = _score(lines, line, delimiter, needed)
    if not known and not is_even:
        hint = (
            f"A table has a header with {', '.join(needed.values())} within the first "
            f"{_SEARCHED} lines, parted by tabs, semicolons, commas or blanks."
        )
    names = ", ".join(name for name in header if name)[:300] or "none"
    return refused_line(
        path, line + 1, f"no column {', '.join(missing)}; it has {names}", hint
    )


def _score(
    lines: Sequence[str], k: int, delimiter: str, needed: Mapping[str, str]
) -> tuple[int, bool, int]:
    """Return how much a line looks like the header."""
    header = _header_cells(_uncommented(lines[k]), delimiter)
    known = sum(bool(find_column(header, column)) for column in needed.values())
    has_rows = any(line.strip() for line in lines[k + 1 :])
    is_even = has_rows and _has_width(lines, k + 1, delimiter, len(header))
    return known, is_even, min(len(header), _FEWEST)


def _place_hint(cells: int) -> str:
    if cells >= len(COLUMNS):
        named = ",".join(f"{name}={k}" for k, name in enumerate(COLUMNS, 1))
        return f"Say which is which, counted from 1: --columns {named}"
    named = ",".join(f"{name}={k}" for k, name in enumerate(COLUMNS[1:], 1))
    return f"Say which is which, counted from 1: --rate HZ --columns {named}"


def _has_width(lines: Sequence[str], first: int, delimiter: str, width: int) -> bool:
    """Return whether the rows from `first` on have as many cells as the header."""
    below = islice((line for line in lines[first:] if line.strip()), _COMPARED)
    return width >= _FEWEST and all(
        is_as_wide(_cells(line, delimiter), width) for line in below
    )


def is_as_wide(cells: Sequence[str], width: int) -> bool:
    """Return whether a row has so many cells; empty ones at its end do not count."""
    return len(cells) == width or (len(cells) > width and not any(cells[width:]))


def _header_cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a header; beside blanks a unit belongs to the name before."""
    cells = _cells(line, delimiter)
    if delimiter != BLANKS:
        return cells
    joined: list[str] = []
    for cell in cells:
        is_unit = cell[:1] in {"[", "("} and cell[-1:] in {"]", ")"}
        if is_unit and joined and not joined[-1].startswith(("[", "(")):
            joined[-1] += f" {cell}"
        else:
            joined.append(cell)
    return joined


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        rows = list(numbered_rows([line], delimiter))
    except UnfitQuotesError:
        return []
    return [cell.strip() for _, row in rows for cell in row]


def _uncommented(line: str) -> str:
    bare = line.lstrip()
    for sign in _COMMENTS:
        if bare.startswith(sign):
            return bare.lstrip(sign).lstrip(" ")
    return line


def _is_value(cell: str) -> bool:
    """Return whether a cell holds a number under some mark, a time or no value."""
    if is_iso(cell):
        return True
    return any(NumberForm(mark, True).number(cell) is not None for mark in MARKS)
