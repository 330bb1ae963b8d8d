"""Reports of external tables: checks, study and page."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from acquisition.errors import SettingsError
from acquisition.wording import counted
from analysis.data.series import TractionSeries
from analysis.logs.record import ImportRecord, read_record
from analysis.report.sections.imported import import_tables
from analysis.study.study import Study, StudyOptions, notes_of_tables, run_study
from experiments.operator.console import WARNING, Console
from experiments.report.choices import ReportRequest
from experiments.report.duplicates import TrialDigests
from experiments.report.progress import fitting
from experiments.report.study_report import (
    ReportedStudy,
    report_study,
    require_folder,
)
from experiments.session.data_files import make_empty

Trials = Mapping[str, Sequence[TractionSeries]]
_TENSION = 0.5  # share of negative rows above which F_n has the wrong sign


def report_tables_of_trials(
    files: Sequence[Path],
    out: Path,
    trials: Trials,
    with_columns: Trials,
    request: ReportRequest,
    console: Console,
) -> Path:
    """Fit trials from tables and write the report; returns the page.

    Args:
        files: files of the trials.
        out: folder of the report.
        trials: trials by terrain.
        with_columns: the same with the columns to test.
        request: options of the report.
        console: output of progress and warnings.

    Raises:
        SessionError: `out` is not empty.
        SettingsError: a choice does not suit tables, simulated and recorded trials are
            mixed, a trial is duplicate, or no sample is left to fit.
    """
    for choice in request.choices.variants:  # refused before anything is fitted
        choice.series(next(iter(trials.values()))[0])
    is_simulated = _is_simulated(trials)
    _refuse_repeated(trials)
    _refuse_tension(trials)
    require_folder(out)
    make_empty(out)
    imports = _import_records(files)
    notes = [*_import_notes(imports), *notes_of_tables(trials)]
    for note in notes:  # before the work: a wrong unit shows here
        console.say(f"{WARNING} {note}")
    count = sum(len(series) for series in trials.values())
    console.say(
        f"{counted(count, 'trial')} on {counted(len(trials), 'terrain')}: fitting ..."
    )
    options = StudyOptions(
        request.choices.prepare, fit=request.fit, scheduler=request.scheduler
    )
    with fitting(console) as progress:
        study = run_study(trials, options, is_simulated, progress, with_break_away=True)
    require_samples(study)
    reported = ReportedStudy(
        study,
        title="Traction from external data",
        subtitle=f"{counted(count, 'trial')} from {counted(len(files), 'file')}",
        is_foreign=True,
        trials=trials,
        with_columns=with_columns,
        tables=[t for record in imports.values() for t in import_tables(record)],
    )
    page = report_study(reported, out, request, console)
    for note in study.groups:
        console.say(note)
    for warning in study.warnings:
        if warning not in notes:
            console.say(f"{WARNING} {warning}")
    return page


def require_samples(study: Study) -> None:
    """Refuse a study without a sample to fit.

    Raises:
        SettingsError: no terrain has a sample inside the window.
    """
    if any(result.kept for result in study.terrains.values()):
        return
    prepare = study.options.prepare
    present = np.concatenate(
        [trial.smooth.v_t for r in study.terrains.values() for trial in r.trials]
    )
    slow, fast = float(present.min()), float(present.max())
    forward = np.quantile(present[present > 0.0], (0.05, 0.95)) if fast > 0 else None
    hint = (
        "No row moves forward: --negate v_t turns its sign."
        if forward is None
        else f"--window {forward[0]:.3g}:{forward[1]:.3g} keeps nine in ten of those "
        "that move forward; or check the unit of v_t."
    )
    raise SettingsError(
        "No sample is left to fit: none moves forward at "
        f"{prepare.slowest:g} to {prepare.fastest:g} m/s (--window); v_t is {slow:.3g} "
        f"to {fast:.3g} m/s.",
        hint=" ".join([hint, *study.warnings]),
    )


def _import_records(files: Sequence[Path]) -> dict[Path, ImportRecord]:
    """Records of the imports that made the trials, by folder."""
    folders = dict.fromkeys(path if path.is_dir() else path.parent for path in files)
    records = {folder: read_record(folder) for folder in folders}
    return {folder: record for folder, record in records.items() if record}


def _import_notes(records: Mapping[Path, ImportRecord]) -> list[str]:
    return [
        f"{folder}: warnings of its import: {len(record.warnings)}, see Imported in "
        f"the report; the first: {record.warnings[0]}"
        for folder, record in records.items()
        if record.warnings
    ]


def _refuse_tension(trials: Trials) -> None:
    """Refuse a trial whose normal force is negative in most rows.

    Raises:
        SettingsError: F_n has the sign of tension.
    """
    for series in (trial for group in trials.values() for trial in group):
        present = series.F_n[np.isfinite(series.F_n) & (series.F_n != 0.0)]
        negative = float(np.mean(present < 0.0)) if present.size else 0.0
        if negative > _TENSION:
            raise SettingsError(
                f"{series.terrain} {series.name}: F_n is negative in {negative:.0%} of "
                "the rows.",
                hint="Compression is positive: --negate F_n turns its sign.",
            )


def _refuse_repeated(trials: Trials) -> None:
    digests = TrialDigests()
    for series in (trial for group in trials.values() for trial in group):
        name = f"{series.terrain} {series.name}"
        columns = (series.t - series.t[0], series.v_t, series.F_n, series.F_t)
        if (original := digests.original(name, *columns)) is not None:
            raise SettingsError(
                f"{name} holds the same trial as {original}.",
                hint="Give each trial once.",
            )


def _is_simulated(trials: Trials) -> bool:
    """Return whether the trials are simulated; refuses a mixture."""
    kinds = {trial.is_simulated for series in trials.values() for trial in series}
    if len(kinds) > 1:
        raise SettingsError(
            "A report cannot mix simulated and recorded trials.",
            hint="Give the tables of one kind only.",
        )
    return True in kinds
