"""Data package of imported trials, in the form of `traction export`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path

from acquisition.files import open_regular
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.recorded_factors import value_text
from analysis.logs.channels import JointChannel, MessageTimes, WrenchChannel
from analysis.logs.importing import ImportedLog, ImportedTrial
from analysis.logs.log_file import LogTopic
from analysis.logs.opening import log_files
from analysis.logs.record import (
    RECORD,
    ImportedFigure,
    ImportedFile,
    ImportedTopic,
    ImportRecord,
)
from analysis.tables.data_package import TableOrigin
from experiments import provenance
from experiments.export.quantities import KEPT, QUANTITIES, kept_rule
from experiments.export.table_columns import Quantity, Values, columns_of
from experiments.export.trial_tables import (
    DICTIONARY,
    DICTIONARY_MEANINGS,
    INDEX,
    TableWriter,
    column_rows,
)
from experiments.operator.console import WARNING, Console
from experiments.session.data_files import make_empty, write_new

_Read = Callable[[ImportedTrial], Values]
# Quantities of own recordings: unit, frame, meaning, digits.
_KNOWN = {name: q for q in QUANTITIES for name in q.names}
_AXES = ("x", "y", "z")
_ANGLE = 1e-6  # rad or m: finer than any joint encoder
_INDEX_MEANINGS = {
    "table": "file of the trial at the rate of the joints",
    "log": "name of the log",
    "terrain": "name of the terrain",
    "start": "of the trial, in seconds of the log",
    "end": "of the trial, in seconds of the log",
    "sha256 of the log": "SHA-256 of the log, of the first file of several",
}


def write_imported(
    imported: ImportedLog,
    arguments: Mapping[str, str],
    to: Path,
    form: str,
    console: Console,
) -> None:
    """Write the trials of a log below `to`, which must be empty.

    Args:
        imported: the imported log.
        arguments: arguments of the command, for `import.json`.
        to: the folder.
        form: "csv" or "parquet".
        console: output of the written files.

    Raises:
        SessionError: `to` is not empty.
        TrialFileError: a table cannot be written.
        MissingLibraryError: Parquet is requested and pyarrow is not installed.
    """
    record = record_of(imported, arguments)
    make_empty(to)
    writer = TableWriter(to, form)
    digest = record.files[0].sha256
    rows: list[list[str]] = []
    for trial in imported.trials:
        file = _write_trial(writer, imported, trial, digest)
        ends = (f"{trial.start:.3f}", f"{trial.start + trial.t[-1]:.3f}")
        stated = [value_text(v, 12) for v in imported.request.factors.values()]
        log = imported.request.log.name
        rows.append([file, log, imported.request.terrain, *ends, digest, *stated])
        console.say(f"{trial.name}: {len(trial.t)} rows from {ends[0]} s")
    factors = dict.fromkeys(imported.request.factors, "factor")
    index = {**_INDEX_MEANINGS, **factors}
    writer.add_texts(INDEX, rows, index, "The trials.")
    meanings = column_rows(f"T01.{form}", quantities_of(imported))
    meanings += column_rows(f"T01.kept.{form}", KEPT)
    writer.add_texts(DICTIONARY, meanings, DICTIONARY_MEANINGS, "Every column.")
    write_new(to / RECORD, record.text().encode())
    kind = "Imported SIMULATED trials" if imported.is_simulated else "Imported trials"
    about = f"{kind}; {RECORD} tells how."
    writer.finish(f"Trials imported from {imported.request.log.name}", about)
    if imported.is_simulated:
        console.say(f"{WARNING} SIMULATED by the metadata of the log.")
    for warning in imported.warnings:
        console.say(f"{WARNING} {warning}")


def quantities_of(imported: ImportedLog) -> tuple[Quantity[ImportedTrial], ...]:
    """Return the columns of an imported trial."""
    joints = imported.joint_names
    names = tuple(f"q{k + 1}" for k in range(len(joints)))
    base = f"base of {imported.urdf.name or 'the robot'}"
    sensor = imported.request.sensor
    return (
        _like("t", ("t",), lambda x: x.t, "joints' clock", "since the first row"),
        Quantity(
            names,
            "rad",
            "joints",
            f"positions of {', '.join(joints)}; m where a joint slides",
            lambda x: x.q,
            _ANGLE,
            "number",
        ),
        _like("raw_fx", _named("raw_f"), lambda x: x.raw[:, :3], sensor),
        _like("raw_tx", _named("raw_t"), lambda x: x.raw[:, 3:], sensor),
        _like("sole_x", _named("foot_"), lambda x: x.foot, base, "the foot's frame"),
        _like("v_x", _named("v_"), lambda x: x.velocity, base, "velocity of the foot"),
        _like("F_x", _named("F_"), lambda x: x.force, base),
        _like("v_t", ("v_t",), lambda x: x.traction[:, 0]),
        _like("F_t", ("F_t",), lambda x: x.traction[:, 1]),
        _like("F_n", ("F_n",), lambda x: x.traction[:, 2]),
    )


def _named(prefix: str) -> tuple[str, ...]:
    return tuple(prefix + axis for axis in _AXES)


def _like(
    known: str,
    names: tuple[str, ...],
    values: _Read,
    frame: str = "",
    meaning: str = "",
) -> Quantity[ImportedTrial]:
    """Return a quantity with unit and digits of an own quantity `known`."""
    q = _KNOWN[known]
    return Quantity(
        names,
        q.unit,
        frame or q.frame,
        meaning or q.meaning,
        values,
        q.resolution,
        "number",
        q.more_digits,
    )


def _write_trial(
    writer: TableWriter, imported: ImportedLog, trial: ImportedTrial, digest: str
) -> str:
    """Write both tables of a trial; returns the file of the complete one."""
    request, series = imported.request, trial.series
    origin = TableOrigin(
        table="trial",
        session=request.log.name[:60],
        trial=trial.name,
        terrain=series.terrain,
        incline_deg=series.incline_deg,
        factors=dict(series.factors),
        recording=digest,
        imported=True,
        rig=imported.urdf.name,
        simulated=imported.is_simulated,
    )
    whole = columns_of(quantities_of(imported), trial)
    file = writer.add(trial.name, whole, origin, "A trial at the rate of the joints.")
    options = PrepareOptions()
    kept = columns_of(KEPT, prepare_trial(series, options))
    rule = f"Samples that models are fitted to: {kept_rule(options)}."
    of_kept = origin.model_copy(update={"table": "kept"})
    writer.add(f"{trial.name}.kept", kept, of_kept, rule)
    return file


def record_of(imported: ImportedLog, arguments: Mapping[str, str]) -> ImportRecord:
    """Return the content of `import.json`; raises SettingsError."""
    request = imported.request
    files = [("log", path) for path in log_files(request.log)]
    files.append(("urdf", request.urdf))
    joints, wrench = imported.joints, imported.wrench
    return ImportRecord(
        log_format=imported.format,
        robot=imported.urdf.name,
        joints=tuple(imported.joint_names),
        is_estimated=request.is_estimated,
        files=tuple(_file(what, path) for what, path in files),
        topics=(
            _topic("joints", joints, ""),
            _topic("wrench", wrench, wrench.frame_id),
        ),
        arguments=dict(arguments),
        checks=tuple(
            ImportedFigure(
                name=check.name,
                value=check.stated,
                unit=check.unit,
                shown=check.shown,
                spread=check.spread,
                how=check.how,
            )
            for check in imported.checks
        ),
        trials={
            trial.name: (trial.start, trial.start + float(trial.t[-1]))
            for trial in imported.trials
        },
        warnings=tuple(imported.warnings),
        losses=tuple(imported.losses),
        versions=provenance.collect(),
    )


def _file(what: str, path: Path) -> ImportedFile:
    with open_regular(path, is_link_followed=True) as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return ImportedFile(what=what, path=path.name, bytes=file.tell(), sha256=digest)


def _topic(
    what: str,
    channel: JointChannel | WrenchChannel,
    frame_id: str,
) -> ImportedTopic:
    topic: LogTopic = channel.topic
    clock: MessageTimes = channel.clock
    median, most = clock.late
    return ImportedTopic(
        what=what,
        name=topic.name,
        type=topic.type_name,
        frame_id=frame_id,
        times=clock.by,
        read=clock.read,
        used=len(clock.times_ns),
        dropped=sum(clock.left_out.values()),
        repeated=clock.repeated,
        overtaken=clock.overtaken,
        rate_by_stamp=clock.rate_by_stamp,
        rate_by_receipt=clock.rate_by_receipt,
        late_ms=(median * 1e3, most * 1e3),
        longest_gap_ms=clock.widest * 1e3,
    )
