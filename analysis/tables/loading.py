"""Loading of tables as trials: CSV, Parquet, npz with one array per trial, packages.

Files are untrusted: sizes are checked before anything is unpacked, nothing is
unpickled, and every problem becomes one SettingsError that names the file. `text` reads
text tables.
"""

import glob
import math
import os
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, open_regular
from acquisition.wording import counted
from analysis.data.memory import share_of_memory
from analysis.data.series import Array, TractionSeries
from analysis.tables.checks import check_clock, check_order, check_size, notes_of
from analysis.tables.columns import COLUMNS, GROUPS, factor
from analysis.tables.data_package import (
    PackagedTable,
    TableOrigin,
    is_package,
    packaged_table,
    packaged_tables,
)
from analysis.tables.other_formats import ENOUGH, check_kind, not_an_npz
from analysis.tables.parquet import MAGIC, read_parquet
from analysis.tables.refusals import refusal
from analysis.tables.text import BLANKS, TextForm, read_text_table
from analysis.tables.trial_table import TrialTable

DEFAULT_TERRAIN = "table"
LARGEST_FILE = 24_000_000  # bytes of a table; six times as much in memory
LARGEST_RATIO = 100  # unpacked to packed size of an npz above that size
PARTS = 8  # an npz, or all trials of a CSV, may take 1/8 of the free memory
_TRIAL = 12_000  # least bytes in memory per trial
_LARGE_TIME = 1e6  # in its unit; larger times are counted from an epoch
_LARGEST_INPUT = 1e12  # in its unit; squares of larger values lose precision

_ZIP = b"PK"  # first bytes of an npz
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
    negate: Sequence[str] = (),
    inputs: Sequence[str] = (),
    separator: str = ",",
    decimal: str = ".",
    skipped: frozenset[int] = frozenset(),
) -> dict[str, list[TractionSeries]]:
    """Load the trials in `paths` by terrain, in the order of the files.

    Args:
        paths: CSV and Parquet files with one trial each; npz files with any number of
            trials; folders of `traction export`, of which every whole trial is read.
            `~` and patterns such as `*.csv` are expanded.
        columns: name of each column of the analysis in a CSV or Parquet file, or its
            position from "1"; by default its own name. In addition "trial" and
            "terrain": text columns that divide a CSV into several trials.
        terrain: terrain of every CSV and Parquet file; by default that of its data
            package, or "table". An npz or an exported folder names its own.
        stones: size of the stones by terrain: "small", "big" or "none"; if not given,
            see `analysis.data.terrain_kinds.terrain_kind`.
        units: unit of each column without a unit in the header, e.g. {"v_t": "mm/s"};
            s, m/s and N by default.
        rate: sampling rate of a CSV without times [Hz].
        negate: columns to negate, e.g. F_n of a machine with negative compression.
        inputs: further numeric columns: model inputs in addition to F_n and v_t.
        separator: one character between the columns of a CSV, or "blanks" for runs of
            blanks.
        decimal: decimal mark of a CSV, "." or ",".
        skipped: lines of a CSV to skip, from 1.

    Raises:
        SettingsError: a file is missing, too large or invalid.
    """
    _check_names({*(columns or {})} - {*GROUPS} | {*(units or {}), *negate})
    _check_layout(separator, decimal)
    if not (rate is None or _is_rate(rate)):
        raise SettingsError(
            f"{rate!r} is not a rate.", hint="Give rows per second [Hz]."
        )
    if terrain is not None and "terrain" in (columns or {}):
        raise SettingsError(
            f"The terrain is {terrain}, and a column of it is named too.",
            hint="Leave out one: --terrain, or terrain= of --columns.",
        )
    columns = {n: n for n in (*COLUMNS, *inputs)} | dict(columns or {})
    text = TextForm(columns, separator, decimal, skipped, rate)
    form = _TableForm(text, terrain, stones or {}, units or {}, frozenset(negate))
    trials: dict[str, list[TractionSeries]] = {}
    for path in (file for given in paths for file in _expanded(given)):
        for series in _load(path, form):
            trials.setdefault(series.terrain, []).append(series)
    if not trials:
        raise SettingsError("No table was given.", hint="Name at least one file.")
    _check_further_units([series for group in trials.values() for series in group])
    return trials


def _check_layout(separator: str, decimal: str) -> None:
    if decimal not in {".", ","}:
        raise SettingsError(f"{decimal!r} is no decimal mark.", hint='Give "." or ",".')
    is_one = len(separator) == 1 and not separator.isalnum() and separator not in '.+-"'
    if not (is_one or separator == BLANKS):
        raise SettingsError(
            f"{separator!r} cannot separate columns.",
            hint=f"Give one character such as , or ; or a tab, or {BLANKS}.",
        )


def _check_further_units(trials: Sequence[TractionSeries]) -> None:
    """Refuse a further column whose unit differs between tables."""
    first: dict[str, TractionSeries] = {}
    for series in trials:
        for name in series.further:
            other = first.setdefault(name, series)
            units = [table.units.get(name, "") for table in (other, series)]
            if units[0] != units[1]:
                here, there = (
                    f"in {unit}" if unit else "without a unit" for unit in units
                )
                raise SettingsError(
                    f"Column {name} is {here} in {other.name} and {there} in "
                    f"{series.name}.",
                    hint="Save all tables with one unit of it.",
                )


def _is_rate(rate: object) -> bool:
    """Return whether `rate` is a positive finite number."""
    if isinstance(rate, bool) or not isinstance(rate, Real):
        return False
    return 0.0 < float(rate) < math.inf


def _check_names(names: set[str]) -> None:
    """Refuse names that are not columns of the analysis."""
    if strangers := names - {*COLUMNS}:
        raise SettingsError(
            f"{', '.join(sorted(map(str, strangers)))}: no column of the analysis.",
            hint=f"The columns are {', '.join(COLUMNS)}.",
        )


def _expanded(path: Path) -> list[Path]:
    """Expand `~` and patterns in a path.

    Raises:
        SettingsError: a pattern matches no file, or there is no such user.
    """
    if os.path.lexists(path):
        return [path]
    try:
        path = path.expanduser()
    except RuntimeError as error:
        raise SettingsError(f"{path}: {error}.", hint="Check the name.") from error
    if os.path.lexists(path) or not glob.has_magic(str(path)):
        return [path]
    files = sorted(map(Path, glob.glob(str(path))))  # noqa: PTH207  a pattern may be absolute
    if not files:
        raise SettingsError(f"{path}: no file matches this pattern.", hint="Check it.")
    return files


@dataclass(frozen=True, slots=True)
class _TableForm:
    """Options for reading tables.

    Attributes:
        text: columns, rate and decimal mark.
        terrain: terrain of every CSV; None = as stated by its package.
        stones: size of the stones by terrain, if given.
        units: unit by column, if given.
        negate: columns to negate.
    """

    text: TextForm
    terrain: str | None
    stones: Mapping[str, str]
    units: Mapping[str, str]
    negate: frozenset[str]

    def series(
        self, name: str, path: Path, table: TrialTable, origin: TableOrigin
    ) -> TractionSeries:
        """Convert a table to a trial of its terrain.

        Raises:
            SettingsError: a unit is unknown or contradictory, or the rows do not form a
                trial.
        """
        rows = self._in_own_units(name, table)
        is_timed = (
            table.is_in_seconds
            or table.is_prepared
            or self.text.rate is not None
            or bool(table.units.get("t") or self.units.get("t"))
        )
        notes: list[str] = []
        if not origin.session:
            check_order(path, table, rows)
            check_clock(path, rows, is_timed)
            check_size(path, table, rows)
            notes = list(notes_of(path, table, rows))
        if further := list(table.further.values()):
            _check_inputs(path, table.further)
            is_lacking = ~np.isfinite(np.column_stack(further)).all(axis=1)
            if count := int(np.count_nonzero(is_lacking)):
                notes.append(
                    f"{counted(count, 'row')} without a value of an input dropped"
                )
        terrain = self.terrain or origin.terrain or DEFAULT_TERRAIN
        return TractionSeries(
            terrain,
            name,
            *rows.T,
            stones=self.stones.get(terrain, origin.stones),
            incline_deg=origin.incline_deg,
            factors=origin.factors,
            units={n: u for n, u in table.units.items() if n in table.further},
            stamped_lag=origin.force_age,
            is_prepared=table.is_prepared,
            is_simulated=origin.simulated or table.is_simulated is True,
            is_foreign=origin.imported or not origin.session,
            notes=tuple(notes),
            further=table.further,
        )

    def _in_own_units(self, name: str, table: TrialTable) -> Array:
        """Convert rows to s, m/s and N, shape (n, 4); large times start from zero."""
        stated, asked = table.units, self.units
        t = table.rows[:, 0]
        first = float(t[np.isfinite(t)][0]) if np.isfinite(t).any() else 0.0
        if abs(first) > _LARGE_TIME:  # preserves the precision of the steps
            t = t - first
        try:
            factors = np.array(
                [factor(n, stated.get(n, ""), asked.get(n, "")) for n in COLUMNS]
            )
        except SettingsError as error:
            where = name if table.header is None else f"{name}, line {table.header}"
            raise SettingsError(f"{where}: {error.message}", hint=error.hint) from error
        signs = np.array([-1.0 if n in self.negate else 1.0 for n in COLUMNS])
        rows = np.column_stack([t, table.rows[:, 1:]])
        return rows * factors * signs


def _check_inputs(path: Path, further: Mapping[str, Array]) -> None:
    """Refuse inputs too large for the models."""
    for name, values in further.items():
        sizes = np.abs(values[np.isfinite(values)])
        largest = float(sizes.max(initial=0.0))
        if largest > _LARGEST_INPUT:
            raise refusal(
                path,
                f"column {name} has a value of {largest:g}, beyond {_LARGEST_INPUT:g}",
                "Leave the cell empty if there is no value, or use a larger unit.",
            )


def _load(path: Path, form: _TableForm) -> list[TractionSeries]:
    if is_package(path):
        return _load_package(path, form)
    start = _first_bytes(path)
    check_kind(path, start)
    if start[:2] == _ZIP:
        _refuse_rate(path, form)
        return _load_npz(path, replace(form, terrain=None))
    packaged = packaged_table(path)
    if packaged is None:
        return _load_table(path, form, None)
    packaged.check()
    return _load_table(path, form, packaged.origin)


def _first_bytes(path: Path) -> bytes:
    """Return the first bytes of a readable file; refuse any other."""
    try:
        with open_regular(path, is_link_followed=True) as file:
            size = os.fstat(file.fileno()).st_size
            start = file.read(ENOUGH)
    except UnfitFileError as error:
        raise refusal(path, f"it {error}", "Give tables of trials.") from error
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be read ({error.strerror}).", hint="Check the name."
        ) from error
    if size == 0:
        raise refusal(path, "the file is empty", "Check that it was copied completely.")
    _check_size(path, size, _largest_npz() if start[:2] == _ZIP else LARGEST_FILE)
    return start


def _refuse_rate(path: Path, form: _TableForm) -> None:
    if form.text.rate is not None:
        raise refusal(path, "has a time of its own", "Leave --rate out.")


def _load_package(path: Path, form: _TableForm) -> list[TractionSeries]:
    """Load every whole trial of a data package."""
    tables = [t for t in packaged_tables(path) if t.origin.table == "trial"]
    if not tables:
        raise refusal(path, "no trials in it", "Give a folder of traction export.")
    own = replace(form, terrain=None)  # every trial of a package names its terrain
    return [series for table in tables for series in _load_packaged(table, own)]


def _load_packaged(table: PackagedTable, form: _TableForm) -> list[TractionSeries]:
    _first_bytes(table.path)
    table.check()
    return _load_table(table.path, form, table.origin)


def _load_table(
    path: Path, form: _TableForm, origin: TableOrigin | None
) -> list[TractionSeries]:
    """Load the trial in a CSV or Parquet file, or the trials of a CSV."""
    with path.open("rb") as file:
        is_parquet = file.read(4) == MAGIC
    if is_parquet:
        read = _load_parquet(path, form)
        table, origin = read.table, origin or read.origin
    else:
        table = read_text_table(path, form.text, LARGEST_FILE)
    known = origin or TableOrigin(table="trial")
    name = known.name if known.session else path.name
    if not table.groups:
        return [form.series(name, path, table, known)]
    return [
        form.series(f"{name}:{part.label}", path, part.table, part.of(known))
        for part in _parts(path, table, form.text.rate)
    ]


class _TablePart(NamedTuple):
    """The rows of a table that belong to one trial."""

    terrain: str
    trial: str
    table: TrialTable

    @property
    def label(self) -> str:
        """Terrain and trial, as far as the table names them."""
        return "/".join(filter(None, (self.terrain, self.trial)))

    def of(self, origin: TableOrigin) -> TableOrigin:
        """Return the origin with the terrain named by the rows."""
        if not self.terrain:
            return origin
        return origin.model_copy(update={"terrain": self.terrain})


def _parts(path: Path, table: TrialTable, rate: float | None) -> list[_TablePart]:
    """Divide a table by its text columns into trials, in the order of its rows.

    Without a time column, the times of every trial start from zero.

    Raises:
        SettingsError: a row has no text, or there are too many trials.
    """
    nothing = [""] * len(table.rows)
    keys = list(zip(*(table.groups.get(n, nothing) for n in GROUPS), strict=True))
    trials = dict.fromkeys(keys)
    for name, words in table.groups.items():
        if "" in words:
            where = table.location(words.index(""))
            raise refusal(path, f"{where}: no {name}", "Name it in every row.")
    if len(trials) > (most := most_trials()):
        raise refusal(
            path,
            f"{len(trials)} trials by {' and '.join(table.groups)}, the limit is "
            f"{most} by the free memory",
            "Name a column that divides it into fewer.",
        )
    rows_of: dict[tuple[str, ...], list[int]] = {key: [] for key in trials}
    for row, key in enumerate(keys):
        rows_of[key].append(row)
    parts = []
    for (trial, terrain), of_trial in rows_of.items():
        chosen = np.array(of_trial)
        rows = table.rows[chosen]
        if rate is not None:
            rows[:, 0] = np.arange(chosen.size) / rate
        part = replace(
            table,
            rows=rows,
            lines=None if table.lines is None else table.lines[chosen],
            further={name: x[chosen] for name, x in table.further.items()},
            groups={},
        )
        parts.append(_TablePart(terrain, trial, part))
    return parts


class _ParquetTrial(NamedTuple):
    """A Parquet table and its stated origin."""

    table: TrialTable
    origin: TableOrigin | None


def _load_parquet(path: Path, form: _TableForm) -> _ParquetTrial:
    _refuse_rate(path, form)
    if form.text.groups:
        raise refusal(
            path,
            f"--columns {form.text.groups[0]}=: a Parquet file holds one trial",
            "Give a file per trial, or a CSV.",
        )
    wanted = (*COLUMNS, *form.text.further)
    file = read_parquet(path, {name: form.text.columns[name] for name in wanted})
    rows = np.column_stack([file.columns[name] for name in COLUMNS])
    table = TrialTable(
        rows,
        file.units,
        file.is_prepared,
        file.is_simulated,
        further={name: file.columns[name] for name in form.text.further},
    )
    return _ParquetTrial(table, file.origin)


def _check_size(path: Path, size: int, limit: int) -> None:
    if size > limit:
        by_memory = " by the free memory" if limit > LARGEST_FILE else ""
        raise refusal(
            path,
            f"{size / 1e6:.0f} MB, the limit is {limit / 1e6:.0f} MB{by_memory}",
            "Split it into one file per terrain.",
        )


def most_trials() -> int:
    """Return the limit of trials per file by the free memory, at least 2000."""
    return share_of_memory(PARTS, LARGEST_FILE) // _TRIAL


def _largest_npz() -> int:
    """Return the limit of the unpacked size of an npz by the free memory [bytes]."""
    return share_of_memory(PARTS, LARGEST_FILE)


def _load_npz(path: Path, form: _TableForm) -> list[TractionSeries]:
    if form.text.further or form.text.groups:
        raise refusal(
            path,
            "an npz has four columns and names its trials",
            "For --inputs give CSV or Parquet files, for trial= and terrain= CSV.",
        )
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
        _check_members(path, members, path.stat().st_size)
        with np.load(path, allow_pickle=False) as arrays:
            return [_from_array(path, key, arrays[key], form) for key in arrays.files]
    except _BROKEN_NPZ as error:
        raise refusal(path, f"not a readable npz ({error})", _FORM) from error


def _check_members(path: Path, members: list[zipfile.ZipInfo], packed: int) -> None:
    size = sum(member.file_size for member in members)
    _check_size(path, size, _largest_npz())
    if size > LARGEST_FILE and size > LARGEST_RATIO * packed:
        raise refusal(
            path,
            f"unpacks to {size / packed:.0f} times its size, the limit is "
            f"{LARGEST_RATIO} beyond {LARGEST_FILE / 1e6:.0f} MB",
            "Save it without compression.",
        )
    strangers = [member.filename for member in members if not _is_trial(member)]
    if strangers or not members:
        raise not_an_npz(path, strangers)
    if len(members) > (most := most_trials()):
        raise refusal(path, f"{len(members)} arrays, the limit is {most}", "Split it.")


def _is_trial(member: zipfile.ZipInfo) -> bool:
    terrain, slash, trial = member.filename.removesuffix(".npy").rpartition("/")
    return member.filename.endswith(".npy") and bool(terrain and slash and trial)


def _from_array(
    path: Path, key: str, array: np.ndarray, form: _TableForm
) -> TractionSeries:
    """Convert an array of an npz to a trial; its times are in seconds by definition."""
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
    table = TrialTable(np.asarray(array, dtype=np.float64), {}, is_in_seconds=True)
    origin = TableOrigin(table="trial", terrain=key.rpartition("/")[0])
    return form.series(f"{path.name}:{key}", Path(f"{path}:{key}"), table, origin)
