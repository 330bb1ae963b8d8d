"""Export of trials as tables: CSV or Parquet, data dictionary, data package."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.errors import SessionError
from acquisition.formats import FORMAT
from acquisition.wording import counted
from analysis.data.load import RecordedTrial, load_trial
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.recorded_factors import FOOT, StatedFactors, value_text
from analysis.tables.data_package import (
    DESCRIPTOR,
    DataPackage,
    PackageField,
    PackageFile,
    TableOrigin,
    TableSchema,
)
from analysis.tables.parquet import to_parquet
from experiments.export.checksums import SUMS, digest_of, write_sums
from experiments.export.quantities import KEPT, QUANTITIES, kept_rule
from experiments.export.table_columns import (
    Quantity,
    TableColumn,
    columns_of,
    csv_of,
    csv_of_rows,
)
from experiments.operator.console import WARNING, Console
from experiments.session.data_files import make_empty, write_new
from experiments.session.store import SessionFolder, iso_utc

DICTIONARY, INDEX = "data_dictionary.csv", "trials.csv"
_MEDIA = {"csv": "text/csv", "parquet": "application/vnd.apache.parquet"}
_METADATA = (
    "operator",
    "started_utc",
    "incline_deg",
    "stone_size",
    "tread",
    "simulated",
)
DICTIONARY_MEANINGS = {
    "table": "file, the first trial in the place of all",
    "column": "its name without the unit",
    "unit": "of the numbers; empty for words",
    "frame": "where it is measured",
    "type": "number, integer, boolean (0 or 1) or string",
    "resolution": "of the instrument, in the unit",
    "largest_rounding": "error of a number as it is written, in the unit",
    "meaning": "what it is",
}
_INDEX_MEANINGS = {
    "table": "file of the trial at the recorded rate",
    "session": "id of the session",
    "terrain": "name of the terrain",
    "operator": "who pushed",
    "started_utc": "when the recording began, UTC",
    "incline_deg": "incline of the plane",
    "stone_size": "of the stones: small, big, none, e.g. 12 mm, fine or stones",
    "tread": "of the foot: true, false (bare), or the foot's name",
    "simulated": "true where the devices were simulated",
    "sha256 of the recording": "SHA-256 of the trial file",
}


@dataclass(slots=True)
class TableWriter:
    """Writes tables into a folder and lists them for the data package.

    Attributes:
        folder: the folder.
        form: "csv" or "parquet", for the tables of trials.
        files: the written files.
    """

    folder: Path
    form: str
    files: list[PackageFile] = field(default_factory=list[PackageFile])

    def add(
        self, name: str, columns: Sequence[TableColumn], origin: TableOrigin, about: str
    ) -> str:
        """Write a table of a trial; returns its path relative to the folder."""
        file = f"{name}.{self.form}"
        if self.form == "csv":
            content = csv_of(columns).encode()
            names = [column.header for column in columns]
        else:
            units = {column.name: column.unit for column in columns}
            content = to_parquet({c.name: c.values for c in columns}, units, origin)
            names = [column.name for column in columns]
        fields = [
            PackageField(name=n, type=c.kind, unit=c.unit, description=c.meaning)
            for n, c in zip(names, columns, strict=True)
        ]
        self._write(file, content, fields, origin, about)
        return file

    def add_texts(
        self,
        file: str,
        rows: Sequence[Sequence[str]],
        meanings: Mapping[str, str],
        about: str,
    ) -> None:
        """Write a CSV of texts; `meanings` describes its columns, in order."""
        content = csv_of_rows([tuple(meanings), *rows]).encode()
        fields = [
            PackageField(name=name, type="string", description=text)
            for name, text in meanings.items()
        ]
        kind = "index" if file == INDEX else "dictionary"
        self._write(file, content, fields, TableOrigin(table=kind), about)

    def finish(self, title: str, about: str) -> None:
        """Write `datapackage.json` and the checksums of every file."""
        package = DataPackage(
            name="traction-trials",
            title=title,
            description=about,
            created=iso_utc(SystemClock().utc_ns()),
            version=FORMAT,
            resources=tuple(self.files),
        )
        write_new(self.folder / DESCRIPTOR, package.text().encode())
        write_sums(self.folder)

    def _write(
        self,
        file: str,
        content: bytes,
        fields: Sequence[PackageField],
        origin: TableOrigin,
        about: str,
    ) -> None:
        path = self.folder / file
        write_new(path, content)
        suffix = path.suffix.removeprefix(".")
        entry = PackageFile.model_validate(
            {
                "name": file.removesuffix(path.suffix).replace("/", "-").lower(),
                "path": file,
                "format": suffix,
                "mediatype": _MEDIA[suffix],
                "bytes": len(content),
                "hash": f"sha256:{digest_of(path)}",
                "description": about,
                "schema": TableSchema(fields=tuple(fields)),
                "traction": origin,
            }
        )
        self.files.append(entry)


def export_sessions(
    sessions: Sequence[SessionFolder], to: Path, form: str, console: Console
) -> None:
    """Write the kept trials of `sessions` to the empty folder `to`.

    Per trial a table at 500 Hz and one of the kept samples; an index of the trials, a
    data dictionary, a Frictionless data package, and checksums for `sha256sum -c`.
    `traction fit` and `traction.load_tables` read the folder.

    Args:
        sessions: the sessions.
        to: the folder.
        form: "csv" or "parquet".
        console: output of the written files.

    Raises:
        SessionError: `to` is not empty, or no session has a kept trial.
        TrialFileError: a trial cannot be read, or a table cannot be written.
        MissingLibraryError: Parquet is requested and pyarrow is not installed.
    """
    paths = [(session, path) for session in sessions for path in session.kept_trials()]
    if not paths:
        raise SessionError(f"{', '.join(s.id for s in sessions)}: no kept trials.")
    if form != "csv":
        to_parquet({}, {})  # raises if pyarrow is missing
    make_empty(to)
    writer = TableWriter(to, form)
    rows: list[list[str]] = []
    stated: list[StatedFactors] = []
    for session, path in paths:
        trial = load_trial(path)
        name = f"{session.path.name}/{path.stem}"
        (to / session.path.name).mkdir(exist_ok=True)
        rows.append(_write_trial(writer, name, session, trial))
        stated.append(trial.factors)
        console.say(f"{name}: {len(trial.t)} rows")
    columns = _factor_columns(stated)
    for row, factors in zip(rows, stated, strict=True):
        values = factors.values
        row += [value_text(values[n], 12) if n in values else "" for n in columns]
    index = {**_INDEX_MEANINGS, **columns}
    writer.add_texts(INDEX, rows, index, "The trials.")
    meanings = dictionary_rows(form, index)
    writer.add_texts(DICTIONARY, meanings, DICTIONARY_MEANINGS, "Every column.")
    what = f"Kept trials of {', '.join(s.id for s in sessions)}"
    is_simulated = sessions[0].is_simulated
    writer.finish(what, "SIMULATED trials." if is_simulated else "Recorded trials.")
    if is_simulated:
        console.say(f"{WARNING} SIMULATED: trials.csv says so in every row.")
    trials = counted(len(rows), "trial")
    console.say(f"{trials} in {to}. To check: cd {to} && sha256sum -c {SUMS}")


def _factor_columns(stated: Sequence[StatedFactors]) -> dict[str, str]:
    """Return the factors of trials with their descriptions; {} without factors."""
    units = {name: unit for trial in stated for name, unit in trial.units.items()}
    names = dict.fromkeys(name for trial in stated for name in trial.values)
    if not set(names) - {FOOT}:  # the column `tread` states it
        return {}
    about = {
        name: f"factor [{unit}]" if unit else "factor" for name, unit in units.items()
    }
    return {name: about.get(name, "factor") for name in names}


def _write_trial(
    writer: TableWriter, name: str, session: SessionFolder, trial: RecordedTrial
) -> list[str]:
    """Write both tables of a trial; returns its row of the index."""
    recording = digest_of(trial.path)
    series = trial.series()
    options = PrepareOptions(container_travel=trial.frame.travel)
    origin = TableOrigin(
        table="trial",
        session=session.id,
        trial=trial.path.stem,
        terrain=trial.terrain,
        stones=trial.stones,
        incline_deg=series.incline_deg,
        factors=dict(series.factors),
        force_age=series.stamped_lag,
        simulated=trial.is_simulated,
        recording=recording,
    )
    whole = columns_of(QUANTITIES, trial)
    file = writer.add(name, whole, origin, "A trial at the recorded rate.")
    kept = columns_of(KEPT, prepare_trial(series, options))
    rule = f"Samples that models are fitted to: {kept_rule(options)}."
    of_kept = origin.model_copy(update={"table": "kept"})
    writer.add(f"{name}.kept", kept, of_kept, rule)
    metadata = trial.metadata["trial"]
    values = [metadata.get(key, "") for key in _METADATA]
    return [file, session.id, trial.terrain, *values, recording]


def dictionary_rows(form: str, index: Mapping[str, str]) -> list[list[str]]:
    """Return the rows of the data dictionary, one per column of every table.

    Resolution of the instrument and largest rounding error are in the unit of the
    column.

    Args:
        form: form of the tables of trials, "csv" or "parquet".
        index: descriptions of the columns of the index.
    """
    rows = column_rows(f"T01.{form}", QUANTITIES)
    rows += column_rows(f"T01.kept.{form}", KEPT)
    rule = kept_rule(PrepareOptions())
    about = ["", "", "rule", "", ""]
    rows.append([f"T01.kept.{form}", "(which rows)", *about, rule])
    return rows + [
        [INDEX, name, "", "", "string", "", "", meaning]
        for name, meaning in index.items()
    ]


def column_rows(table: str, quantities: Sequence[Quantity[Any]]) -> list[list[str]]:
    """Return the rows of the data dictionary for one table."""
    rows: list[list[str]] = []
    for q in quantities:
        is_number = q.kind == "number"
        steps = [f"{q.resolution:g}", f"{0.5 * 10.0**-q.decimals:g}"]
        about = [q.unit, q.frame, q.kind, *(steps if is_number else ["", ""])]
        rows += [[table, name, *about, q.meaning] for name in q.names]
    return rows
