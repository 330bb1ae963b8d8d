"""Load trials from a session, a recording or tables."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from acquisition.errors import SessionError, SettingsError
from analysis.data.load import load_trial as recorded_trial
from analysis.tables.loading import load_tables as tables_by_terrain
from experiments.session.kept_files import check_kept
from experiments.session.store import find_session
from traction.trial_sets import TrialSet
from traction.trials import Trial, trial_of

_RECORDED = ".mcap"


def load_session(
    name: str, data: Path | str = "data", *, allow_missing: bool = False
) -> TrialSet:
    """Return the kept trials of a recorded session, checked by their checksums.

    >>> import traction as tr
    >>> session = tr.load_session("S001")
    >>> session
    <S001: 2 trials on TF, simulated>
    >>> session["T02"]
    <Trial S001/T02 on TF: ... s, ... samples at 500 Hz, ... kept, simulated>

    Args:
        name: "S012", the name of its folder, or a path to it.
        data: the data folder, like the option `--data` of the commands.
        allow_missing: skip kept trials that are missing or changed.

    Raises:
        SessionError: there is no such session, or it has no kept trial.
        KeptDataError: a kept trial is missing or changed.
        TrialFileError: a file cannot be read.
    """
    folder = find_session(Path(data), str(name))
    check_kept([folder], allow_missing=allow_missing)
    paths = folder.kept_trials()
    if not paths:
        raise SessionError(f"{folder.id}: no kept trials in {folder.path}.")
    return TrialSet(folder.id, tuple(trial_of(recorded_trial(path)) for path in paths))


def load_trial(path: Path | str) -> Trial:
    """Return one recorded trial, or the trial in one table.

    >>> import traction as tr
    >>> folder = tr.load_session("S001")["T01"].recorded.path.parent
    >>> tr.load_trial(folder / "T01.mcap")
    <Trial S001/T01 on TF: ... s, ... samples at 500 Hz, ... kept, simulated>

    Args:
        path: T04.mcap of a session, or a CSV or Parquet table with the columns t, v_t,
            F_n and F_t.

    Raises:
        TrialFileError: the file is not a readable recording.
        SettingsError: the table cannot be read, or holds more than one trial.
    """
    path = Path(path).expanduser()
    if path.suffix == _RECORDED:
        return trial_of(recorded_trial(path))
    trials = load_tables(path)
    if len(trials) != 1:
        raise SettingsError(
            f"{path} holds {len(trials)} trials.", hint="Read it with load_tables."
        )
    return trials[0]


def load_tables(
    paths: Path | str | Iterable[Path | str],
    columns: Mapping[str, str] | None = None,
    terrain: str | None = None,
    units: Mapping[str, str] | None = None,
    rate: float | None = None,
    negate: Iterable[str] = (),
    separator: str = ",",
    decimal: str = ".",
    skipped: Iterable[int] = (),
) -> TrialSet:
    """Return the trials of tables written by `traction export` or another program.

    >>> import traction as tr
    >>> tr.load_tables("tables")
    <tables: 2 trials on TF, simulated>

    Args:
        paths: a folder of `traction export`, CSV or Parquet files of one trial each, or
            npz files of many; one path or several. `~` and patterns are expanded.
        columns: names of t, v_t, F_n and F_t in the tables, where they differ.
        terrain: of every CSV and Parquet file; by default that of its data package.
        units: of columns whose header gives none, e.g. {"v_t": "mm/s"}.
        rate: rows per second where a CSV has no time [Hz].
        negate: columns with the opposite sign, e.g. ["F_n"].
        separator: between the columns of a CSV: one character, or "blanks".
        decimal: decimal mark of a CSV, "." or ",".
        skipped: numbers from 1 of CSV lines that do not belong to the table.

    Raises:
        SettingsError: a table is missing, too large, changed or not readable.
    """
    files = _files(paths)
    for name, value in (("columns", columns), ("units", units)):
        if value is not None and not isinstance(value, Mapping):
            raise SettingsError(
                f"load_tables: {name} is {value!r:.60}, not a dictionary.",
                hint='Several files go into a list: load_tables(["a.csv", "b.csv"]).',
            )
    tables = tables_by_terrain(
        files,
        columns,
        terrain,
        units=units,
        rate=rate,
        negate=tuple(negate),
        separator=separator,
        decimal=decimal,
        skipped=frozenset(skipped),
    )
    name = files[0].name if len(files) == 1 else f"{len(files)} files"
    return TrialSet(
        name, tuple(trial_of(s) for series in tables.values() for s in series)
    )


def _files(paths: Path | str | Iterable[Path | str]) -> list[Path]:
    """Return one path or several as a list.

    Raises:
        SettingsError: the argument is neither a path nor a list of paths.
    """
    if isinstance(paths, str | Path):
        return [Path(paths)]
    if not isinstance(paths, Mapping) and isinstance(paths, Iterable):
        items = list(paths)
        if all(isinstance(path, str | Path) for path in items):
            return [Path(path) for path in items]
    raise SettingsError(
        f"load_tables: {paths!r:.60} is neither a file name nor a list of file names.",
        hint='Write e.g. load_tables("a.csv") or load_tables(["a.csv", "b.csv"]).',
    )
