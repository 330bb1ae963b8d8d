"""Tables that other programs wrote, as trials: CSV, or npz with one array per trial.

Every byte is taken as hostile: sizes are checked before anything is unpacked, nothing
is unpickled, and whatever does not fit becomes one SettingsError that names the file.
"""

import csv
import stat
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TextIO

import numpy as np

from acquisition import SettingsError
from analysis.data.columns import COLUMNS, factor, split_header
from analysis.data.series import Array, TractionSeries

DEFAULT_TERRAIN = "table"
LARGEST_FILE = 24_000_000  # bytes, also of an npz once unpacked; six times in memory
MOST_TRIALS = 2000
LONGEST_LINE = 65_536  # characters

_NAMED = "Name them: --columns t=...,v_t=...,F_n=...,F_t=..."
_FORM = "An npz holds arrays TERRAIN/NN of four columns: t, v_t, F_n, F_t."
_BROKEN_NPZ = (
    ValueError,
    OSError,
    EOFError,
    MemoryError,
    RuntimeError,  # an encrypted member
    NotImplementedError,  # an unknown compression
    zipfile.BadZipFile,
    zlib.error,
)


def load_tables(
    paths: Sequence[Path],
    columns: Mapping[str, str] | None = None,
    terrain: str | None = None,
    stones: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> dict[str, list[TractionSeries]]:
    """Return the trials in `paths` by terrain, in the order of the files.

    Args:
        paths: CSV files, one trial each, and npz files, any number of trials each.
        columns: name of each column of the analysis in a CSV; by default its own.
        terrain: terrain of every CSV; by default "table". An npz names its own.
        stones: size of the stones by terrain: "small", "big" or "none"; where it is
            not given, see `analysis.data.terrain_kinds.terrain_kind`.
        units: unit of each column where its header gives none, e.g. {"v_t": "mm/s"};
            s, m/s and N by default.

    Raises:
        SettingsError: a file that is missing, too large, or not what it should be.
    """
    columns = {name: name for name in COLUMNS} | dict(columns or {})
    form = _TableForm(columns, terrain or DEFAULT_TERRAIN, stones or {}, units or {})
    trials: dict[str, list[TractionSeries]] = {}
    for path in paths:
        for series in _load(path, form):
            trials.setdefault(series.terrain, []).append(series)
    if not trials:
        raise SettingsError("No table was given.", hint="Name at least one file.")
    return trials


@dataclass(frozen=True, slots=True)
class _TableForm:
    """How tables are read.

    Attributes:
        columns: name of each column of the analysis in a CSV.
        terrain: terrain of every CSV.
        stones: size of the stones by terrain, where it is given.
        units: unit by column, where it is given.
    """

    columns: Mapping[str, str]
    terrain: str
    stones: Mapping[str, str]
    units: Mapping[str, str]

    def factors(self, path: Path, stated: Mapping[str, str]) -> Array:
        """Return what turns the columns of a table into s, m/s and N, shape (4,).

        Raises:
            SettingsError: a unit is not known, or is stated otherwise.
        """
        try:
            units = [(n, stated.get(n, ""), self.units.get(n, "")) for n in COLUMNS]
            return np.array([factor(*unit) for unit in units])
        except SettingsError as error:
            raise SettingsError(f"{path}: {error.message}", hint=error.hint) from error

    def series(self, terrain: str, name: str, table: Array) -> TractionSeries:
        """Return a table (n, 4) of t, v_t, F_n, F_t as a trial."""
        t, v_t, F_n, F_t = table.T
        stones = self.stones.get(terrain, "")
        return TractionSeries(terrain, name, t, v_t, F_n, F_t, stones)


def _load(path: Path, form: _TableForm) -> list[TractionSeries]:
    try:
        status = path.stat()
        size = status.st_size
        if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
            raise _refusal(path, "it is no regular file", "Give CSV or npz files.")
        with path.open("rb") as file:
            start = file.read(4)
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be read ({error.strerror}).", hint="Check the name."
        ) from error
    if size == 0:
        raise _refusal(path, "the file is empty", "Check that it was copied whole.")
    _check_size(path, size)
    if start[:2] == b"PK":
        return _load_npz(path, form)
    return [_load_csv(path, form)]


def _refusal(path: Path, reason: str, hint: str) -> SettingsError:
    return SettingsError(f"{path}: {reason}.", hint=hint)


def _check_size(path: Path, size: int) -> None:
    if size > LARGEST_FILE:
        raise _refusal(
            path,
            f"{size / 1e6:.0f} MB, the limit is {LARGEST_FILE / 1e6:.0f} MB",
            "Split it into one file per terrain.",
        )


def _load_npz(path: Path, form: _TableForm) -> list[TractionSeries]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
        _check_members(path, members)
        with np.load(path, allow_pickle=False) as arrays:
            return [_from_array(path, key, arrays[key], form) for key in arrays.files]
    except _BROKEN_NPZ as error:
        raise _refusal(path, f"not a readable npz ({error})", _FORM) from error


def _check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    _check_size(path, sum(member.file_size for member in members))
    strangers = [member.filename for member in members if not _is_trial(member)]
    if strangers or not members:
        others = ", ".join(strangers[:5]) or "nothing"
        raise _refusal(path, f"no table of trials (it holds {others:.200s})", _FORM)
    if len(members) > MOST_TRIALS:
        raise _refusal(
            path, f"{len(members)} arrays, the limit is {MOST_TRIALS}", "Split it."
        )


def _is_trial(member: zipfile.ZipInfo) -> bool:
    terrain, slash, trial = member.filename.removesuffix(".npy").rpartition("/")
    return member.filename.endswith(".npy") and bool(terrain and slash and trial)


def _from_array(
    path: Path, key: str, array: np.ndarray, form: _TableForm
) -> TractionSeries:
    if (
        array.ndim != 2
        or array.shape[1] != len(COLUMNS)
        or array.dtype.kind not in "fiu"
    ):
        raise _refusal(
            path,
            f"array {key} has shape {array.shape} and type {array.dtype}",
            _FORM,
        )
    table = np.asarray(array, dtype=np.float64) * form.factors(path, {})
    return form.series(key.rpartition("/")[0], f"{path.name}:{key}", table)


def _load_csv(path: Path, form: _TableForm) -> TractionSeries:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = _lines(path, file)
            line = next(lines, "")
            delimiter = _delimiter(line)
            header = next(csv.reader([line], delimiter=delimiter), [])
            places, stated = _places(path, [name.strip() for name in header], form)
            rows = (line for line in lines if line.strip())
            first = next(rows, None)
            if first is None:
                hint = "Check that it was copied whole."
                raise _refusal(path, "a header but no rows", hint)
            table = _numbers(path, chain([first], rows), places, delimiter)
    except UnicodeDecodeError as error:
        raise _refusal(
            path, "neither a text table nor an npz", "Give CSV files in UTF-8."
        ) from error
    except csv.Error as error:
        raise _refusal(
            path, f"its header cannot be read ({error})", "Give a CSV table."
        ) from error
    return form.series(form.terrain, path.name, table * form.factors(path, stated))


def _lines(path: Path, file: TextIO) -> Iterator[str]:
    """Give the lines of a table; one that fills the memory is none."""
    while line := file.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            hint = "Give a table with four columns, a row per line."
            raise _refusal(path, f"a line exceeds {LONGEST_LINE} characters", hint)
        yield line


def _delimiter(header: str) -> str:
    """Return what parts the columns: the most frequent of comma, semicolon and tab."""
    return max(",;\t", key=header.count)


def _places(
    path: Path, header: list[str], form: _TableForm
) -> tuple[list[int], dict[str, str]]:
    """Return (place of each column, unit of each that states one).

    A header `v_t [mm/s]` is the column v_t, or a column of that whole name.
    """
    bare = [split_header(name) for name in header]
    names = [name for name, _ in bare]
    places: list[int] = []
    stated: dict[str, str] = {}
    missing: list[str] = []
    for name in COLUMNS:
        column = form.columns[name]
        if column in header or column in names:
            among = header if column in header else names
            if among.count(column) > 1:
                raise _refusal(path, f"column {column} stands there twice", _NAMED)
            place = among.index(column)
            places.append(place)
            stated[name] = bare[place][1]
        else:
            missing.append(column)
    if missing:
        raise _refusal(
            path,
            f"no column {', '.join(missing)}; it has "
            f"{', '.join(header)[:300] or 'none'}",
            _NAMED,
        )
    return places, stated


def _with_points(row: str, places: list[int], delimiter: str) -> str:
    """Return a row with points for its decimal commas.

    Raises:
        ValueError: a number has both, so one of them groups its digits.
    """
    cells = row.split(delimiter)
    if any("," in cells[k] and "." in cells[k] for k in places if k < len(cells)):
        raise ValueError("a number with a comma and a point")
    return row.replace(",", ".")


def _numbers(
    path: Path, rows: Iterable[str], places: list[int], delimiter: str
) -> Array:
    """Read the columns at `places`; beside semicolons and tabs a comma is a point."""
    if delimiter != ",":
        rows = (_with_points(row, places, delimiter) for row in rows)
    try:
        return np.loadtxt(
            rows,
            delimiter=delimiter,
            usecols=places,
            ndmin=2,
            comments=None,
            quotechar='"',
        )
    except UnicodeDecodeError:
        raise
    except (ValueError, IndexError) as error:
        raise _refusal(
            path,
            f"not only numbers below the header ({error})",
            "Rows are numbered from 0 below the header; nan is allowed, text is not.",
        ) from error
