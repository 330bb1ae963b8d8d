"""Tables that other programs wrote, as trials: CSV, or npz with one array per trial.

Every byte is taken as hostile: sizes are checked before anything is unpacked, nothing
is unpickled, and whatever does not fit becomes one SettingsError that names the file.
"""

import stat
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition import SettingsError
from analysis.data.columns import COLUMNS, CsvTable, factor, load_csv, refusal
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
        paths: CSV files, one trial each, and npz files, any number of trials each.
        columns: name of each column of the analysis in a CSV; by default its own.
        terrain: terrain of every CSV; by default "table". An npz names its own.
        stones: size of the stones by terrain: "small", "big" or "none"; where it is
            not given, see `analysis.data.terrain_kinds.terrain_kind`.
        units: unit of each column where its header gives none, e.g. {"v_t": "mm/s"};
            s, m/s and N by default.
        rate: rows of a CSV per second, where it has no time [Hz].

    Raises:
        SettingsError: a file that is missing, too large, or not what it should be.
    """
    columns = {name: name for name in COLUMNS} | dict(columns or {})
    form = _TableForm(
        columns, terrain or DEFAULT_TERRAIN, stones or {}, units or {}, rate
    )
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
        rate: rows of a CSV per second, where it has no time [Hz].
    """

    columns: Mapping[str, str]
    terrain: str
    stones: Mapping[str, str]
    units: Mapping[str, str]
    rate: float | None

    def series(self, terrain: str, name: str, table: CsvTable) -> TractionSeries:
        """Return a table as a trial.

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
        return TractionSeries(
            *(terrain, name, *(table.rows * factors).T),
            stones=self.stones.get(terrain, ""),
            is_prepared=table.is_prepared,
        )


def _load(path: Path, form: _TableForm) -> list[TractionSeries]:
    try:
        status = path.stat()
        size = status.st_size
        if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
            raise refusal(path, "it is no regular file", "Give CSV or npz files.")
        with path.open("rb") as file:
            start = file.read(4)
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be read ({error.strerror}).", hint="Check the name."
        ) from error
    if size == 0:
        raise refusal(path, "the file is empty", "Check that it was copied whole.")
    _check_size(path, size)
    if start[:2] == b"PK":
        if form.rate is not None:
            raise refusal(path, "has a time of its own", "Leave --rate out.")
        return _load_npz(path, form)
    table = load_csv(path, form.columns, form.rate)
    return [form.series(form.terrain, path.name, table)]


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
    return form.series(key.rpartition("/")[0], f"{path.name}:{key}", table)
