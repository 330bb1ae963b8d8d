"""CSV tables: names and units of their columns, of the header or the command line."""

import csv
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TextIO

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array

COLUMNS = ("t", "v_t", "F_n", "F_t")
PREPARED = "kept_row"  # a column of tables that were prepared before
LONGEST_LINE = 65_536  # characters
_NAMED = "Name them: --columns t=...,v_t=...,F_n=...,F_t=..."
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
_SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}
_FORCES = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
# Factor from each unit that a column may have to its own.
UNITS: Mapping[str, Mapping[str, float]] = {
    "t": _TIMES,
    "v_t": _SPEEDS,
    "F_n": _FORCES,
    "F_t": _FORCES,
}
_HEADER = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")


def parse_columns(text: str) -> dict[str, str]:
    """Return the names of the columns from `t=t_s,v_t=vt_mps,...`.

    Columns that are not mentioned keep their own name.

    Raises:
        SettingsError: a part is not NAME=COLUMN, or names no column of the analysis.
    """
    columns = {name: name for name in COLUMNS}
    for part in filter(None, text.split(",")):
        name, equals, column = (piece.strip() for piece in part.partition("="))
        if not (equals and column) or name not in columns:
            raise SettingsError(
                f"--columns {text}: {part!r} does not name a column.",
                hint="Write e.g. --columns t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N",
            )
        columns[name] = column
    return columns


def parse_units(text: str) -> dict[str, str]:
    """Return the units of columns from `v_t=mm/s,F_t=mN`.

    Raises:
        SettingsError: a part is not NAME=UNIT, or the column has no such unit.
    """
    units: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, equals, unit = (piece.strip() for piece in part.partition("="))
        if not equals or unit not in UNITS.get(name, {}):
            raise SettingsError(
                f"--unit {text}: {part!r} does not give the unit of a column.",
                hint="; ".join(f"{n}: {', '.join(UNITS[n])}" for n in COLUMNS),
            )
        units[name] = unit
    return units


def split_header(header: str) -> tuple[str, str]:
    """Return name and unit of `v_t [mm/s]` or `v_t (mm/s)`; no unit is empty."""
    match = _HEADER.fullmatch(header)
    return (match["name"], match["unit"].strip()) if match else (header, "")


def factor(name: str, stated: str, asked: str) -> float:
    """Return what turns a column into its own unit.

    Args:
        name: of the column.
        stated: its unit as the table says; empty where it says none.
        asked: its unit as the command line says; empty where it says none.

    Raises:
        SettingsError: the two differ, or the table's unit is not known.
    """
    if stated and asked and stated != asked:
        raise SettingsError(
            f"{name} is in {stated} by the table's header and in {asked} by --unit.",
            hint="Leave --unit out, or mend the header.",
        )
    unit = stated or asked
    if unit and unit not in UNITS[name]:
        raise SettingsError(
            f"{name} is in {unit!r}, which is not a unit of it.",
            hint=f"It may be in {', '.join(UNITS[name])}.",
        )
    return UNITS[name][unit] if unit else 1.0


@dataclass(frozen=True, slots=True)
class CsvTable:
    """The rows of a table, in its own units.

    Attributes:
        rows: t, v_t, F_n and F_t, shape (n, 4).
        units: unit by column, where the header states one.
        is_prepared: the rows are samples kept by an earlier preparation.
    """

    rows: Array
    units: Mapping[str, str]
    is_prepared: bool = False


def refusal(path: Path, reason: str, hint: str) -> SettingsError:
    """Return why a file is not read."""
    return SettingsError(f"{path}: {reason}.", hint=hint)


def load_csv(path: Path, columns: Mapping[str, str], rate: float | None) -> CsvTable:
    """Read a CSV table.

    Args:
        path: the file.
        columns: its name of each column of the analysis.
        rate: rows per second, where it has no time [Hz].

    Raises:
        SettingsError: it is no such table, or its time is not that of `rate`.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = _lines(path, file)
            line = next(lines, "")
            delimiter = _delimiter(line)
            header = [
                name.strip()
                for name in next(csv.reader([line], delimiter=delimiter), [])
            ]
            names = {*header, *(split_header(column)[0] for column in header)}
            has_time = rate is None or columns["t"] in names
            indices, stated = _column_indices(path, header, columns, has_time=has_time)
            rows = (line for line in lines if line.strip())
            first = next(rows, None)
            if first is None:
                hint = "Check that it was copied completely."
                raise refusal(path, "a header but no rows", hint)
            table = _numbers(path, chain([first], rows), indices, delimiter)
    except UnicodeDecodeError as error:
        raise refusal(
            path, "neither a text table nor an npz", "Give CSV files in UTF-8."
        ) from error
    except csv.Error as error:
        raise refusal(
            path, f"its header cannot be read ({error})", "Give a CSV table."
        ) from error
    if rate is not None:
        if has_time:
            raise refusal(path, "has a time of its own", "Leave --rate out.")
        table = np.column_stack([np.arange(len(table)) / rate, table])
    return CsvTable(table, stated, is_prepared=PREPARED in names)


def _lines(path: Path, file: TextIO) -> Iterator[str]:
    """Give the lines of a table; one that fills the memory is none."""
    while line := file.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            hint = "Give a table with four columns, a row per line."
            raise refusal(path, f"a line exceeds {LONGEST_LINE} characters", hint)
        yield line


def _delimiter(header: str) -> str:
    """Return what parts the columns: the most frequent of comma, semicolon and tab."""
    return max(",;\t", key=header.count)


def _column_indices(
    path: Path, header: list[str], columns: Mapping[str, str], *, has_time: bool
) -> tuple[list[int], dict[str, str]]:
    """Return (index of each column, unit of each that states one).

    A header `v_t [mm/s]` is the column v_t, or a column of that whole name. Without
    `has_time` no time is looked for.
    """
    bare = [split_header(name) for name in header]
    names = [name for name, _ in bare]
    indices: list[int] = []
    stated: dict[str, str] = {}
    missing: list[str] = []
    for name in COLUMNS if has_time else COLUMNS[1:]:
        column = columns[name]
        if column in header or column in names:
            among = header if column in header else names
            if among.count(column) > 1:
                raise refusal(path, f"column {column} occurs twice", _NAMED)
            index = among.index(column)
            indices.append(index)
            stated[name] = bare[index][1]
        else:
            missing.append(column)
    if missing:
        named = _NAMED + (
            " Rows without a time: --rate HZ." if missing == [columns["t"]] else ""
        )
        raise refusal(
            path,
            f"no column {', '.join(missing)}; it has "
            f"{', '.join(header)[:300] or 'none'}",
            named,
        )
    return indices, stated


def _with_points(row: str, indices: list[int], delimiter: str) -> str:
    """Return a row with points for its decimal commas.

    Raises:
        ValueError: a number has both, so one of them groups its digits.
    """
    cells = row.split(delimiter)
    if any("," in cells[k] and "." in cells[k] for k in indices if k < len(cells)):
        raise ValueError("a number with a comma and a point")
    return row.replace(",", ".")


def _numbers(
    path: Path, rows: Iterable[str], indices: list[int], delimiter: str
) -> Array:
    """Read the columns at `indices`; beside semicolons and tabs a comma is a point."""
    if delimiter != ",":
        rows = (_with_points(row, indices, delimiter) for row in rows)
    try:
        return np.loadtxt(
            rows,
            delimiter=delimiter,
            usecols=indices,
            ndmin=2,
            comments=None,
            quotechar='"',
        )
    except UnicodeDecodeError:
        raise
    except (ValueError, IndexError) as error:
        raise refusal(
            path,
            f"not only numbers below the header ({error})",
            "Rows are numbered from 0 below the header; nan is allowed, text is not.",
        ) from error
