"""Tables as trials: CSV, Parquet, npz with one array per trial, data packages.

Every byte is taken as hostile: sizes are checked before anything is unpacked, nothing
is unpickled, and whatever does not fit becomes one SettingsError that names the file.
"""

import os
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, open_regular
from analysis.data.columns import (
    COLUMNS,
    PREPARED,
    CsvTable,
    factor,
    load_csv,
    refusal,
)
from analysis.data.data_package import (
    PackagedTable,
    TableOrigin,
    is_package,
    packaged_table,
    packaged_tables,
)
from analysis.data.parquet_tables import MAGIC, read_parquet
from analysis.data.series import TractionSeries

DEFAULT_TERRAIN = "table"
LARGEST_FILE = 24_000_000  # bytes, also of an npz once unpacked; six times in memory
MOST_TRIALS = 2000

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
    rate: float | None = None,
) -> dict[str, list[TractionSeries]]:
    """Return the trials in `paths` by terrain, in the order of the files.

    Args:
        paths: CSV and Parquet files, one trial each; npz files, any number of trials
            each; folders of `traction export`, of which every whole trial is read.
        columns: name of each column of the analysis in a CSV; by default its own.
        terrain: terrain of every CSV; by default that of the data package it lies in,
            or "table". An npz names its own.
        stones: size of the stones by terrain: "small", "big" or "none"; where it is
            not given, see `analysis.data.terrain_kinds.terrain_kind`.
        units: unit of each column where its header gives none, e.g. {"v_t": "mm/s"};
            s, m/s and N by default.
        rate: rows of a CSV per second, where it has no time [Hz].

    Raises:
        SettingsError: a file that is missing, too large, or not what it should be.
    """
    columns = {name: name for name in COLUMNS} | dict(columns or {})
    form = _TableForm(columns, terrain, stones or {}, units or {}, rate)
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
        terrain: terrain of every CSV; None = as its package says.
        stones: size of the stones by terrain, where it is given.
        units: unit by column, where it is given.
        rate: rows of a CSV per second, where it has no time [Hz].
    """

    columns: Mapping[str, str]
    terrain: str | None
    stones: Mapping[str, str]
    units: Mapping[str, str]
    rate: float | None

    def series(self, name: str, table: CsvTable, origin: TableOrigin) -> TractionSeries:
        """Return a table as a trial of its terrain.

        Raises:
            SettingsError: a unit is not known or is stated otherwise, or the rows make
                no trial.
        """
        try:
            units = [
                (column, table.units.get(column, ""), self.units.get(column, ""))
                for column in COLUMNS
            ]
            factors = np.array([factor(*unit) for unit in units])
        except SettingsError as error:
            raise SettingsError(f"{name}: {error.message}", hint=error.hint) from error
        terrain = self.terrain or origin.terrain or DEFAULT_TERRAIN
        return TractionSeries(
            terrain,
            name,
            *(table.rows * factors).T,
            stones=self.stones.get(terrain, origin.stones),
            incline_deg=origin.incline_deg,
            stamped_lag=origin.force_age,
            is_prepared=table.is_prepared,
            is_simulated=origin.simulated,
        )


def _load(path: Path, form: _TableForm) -> list[TractionSeries]:
    if is_package(path):
        return _load_package(path, form)
    start = _first_bytes(path)
    if start[:2] == b"PK":
        if form.rate is not None:
            raise refusal(path, "has a time of its own", "Leave --rate out.")
        return _load_npz(path, replace(form, terrain=None))
    packaged = packaged_table(path)
    if packaged is None:
        return [_load_table(path, form, None)]
    packaged.check()
    return [_load_table(path, form, packaged.origin)]


def _first_bytes(path: Path) -> bytes:
    """Return how a file begins that may be read; refuse every other one."""
    try:
        with open_regular(path, is_link_followed=True) as file:
            size = os.fstat(file.fileno()).st_size
            start = file.read(4)
    except UnfitFileError as error:
        raise refusal(path, f"it {error}", "Give tables of trials.") from error
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be read ({error.strerror}).", hint="Check the name."
        ) from error
    if size == 0:
        raise refusal(path, "the file is empty", "Check that it was copied completely.")
    _check_size(path, size)
    return start


def _load_package(path: Path, form: _TableForm) -> list[TractionSeries]:
    """Return every whole trial of a data package."""
    tables = [t for t in packaged_tables(path) if t.origin.table == "trial"]
    if not tables:
        raise refusal(path, "no trials in it", "Give a folder of traction export.")
    own = replace(form, terrain=None)  # every trial of a package names its terrain
    return [_load_packaged(table, own) for table in tables]


def _load_packaged(table: PackagedTable, form: _TableForm) -> TractionSeries:
    _first_bytes(table.path)
    table.check()
    return _load_table(table.path, form, table.origin)


def _load_table(
    path: Path, form: _TableForm, origin: TableOrigin | None
) -> TractionSeries:
    """Return the trial in a CSV or Parquet file."""
    with path.open("rb") as file:
        is_parquet = file.read(4) == MAGIC
    if is_parquet:
        read = _load_parquet(path, form)
        table, origin = read.table, origin or read.origin
    else:
        table = load_csv(path, form.columns, form.rate)
    known = origin or TableOrigin(table="trial")
    return form.series(known.name if known.session else path.name, table, known)


class _ParquetTrial(NamedTuple):
    """A Parquet table, and what it says of itself."""

    table: CsvTable
    origin: TableOrigin | None


def _load_parquet(path: Path, form: _TableForm) -> _ParquetTrial:
    if form.rate is not None:
        raise refusal(path, "has a time of its own", "Leave --rate out.")
    file = read_parquet(path, [form.columns[name] for name in COLUMNS])
    missing = [c for c in form.columns.values() if c not in file.columns]
    if missing:
        raise refusal(
            path,
            f"no column {', '.join(missing)}; it has {', '.join(file.names)[:300]}",
            "Name them: --columns t=...,v_t=...,F_n=...,F_t=...",
        )
    rows = np.column_stack([file.columns[form.columns[name]] for name in COLUMNS])
    units = {name: file.units[form.columns[name]] for name in COLUMNS}
    return _ParquetTrial(CsvTable(rows, units, PREPARED in file.names), file.origin)


def _check_size(path: Path, size: int) -> None:
    if size > LARGEST_FILE:
        raise refusal(
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
        raise refusal(path, f"not a readable npz ({error})", _FORM) from error


def _check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    _check_size(path, sum(member.file_size for member in members))
    strangers = [member.filename for member in members if not _is_trial(member)]
    if strangers or not members:
        others = ", ".join(strangers[:5]) or "nothing"
        raise refusal(path, f"no table of trials (it holds {others:.200s})", _FORM)
    if len(members) > MOST_TRIALS:
        raise refusal(
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
        raise refusal(
            path,
            f"array {key} has shape {array.shape} and type {array.dtype}",
            _FORM,
        )
    table = CsvTable(np.asarray(array, dtype=np.float64), {})
    origin = TableOrigin(table="trial", terrain=key.rpartition("/")[0])
    return form.series(f"{path.name}:{key}", table, origin)
