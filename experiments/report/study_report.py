"""Report page of a study, of sessions or of tables."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.errors import SettingsError
from analysis.data.load import RecordedTrial
from analysis.data.series import TractionSeries
from analysis.report.page_model import ReportContext
from analysis.report.results import compute_results
from analysis.report.section import ReportTable
from analysis.report.sections.beyond_paper.further_columns import covariate_tables
from analysis.report.sections.rig_health.health import RigTrial
from analysis.report.sections.sensitivity import (
    StudyVariant,
    comparison_table,
    plain_choice,
)
from analysis.study.store import ResultStore
from analysis.study.study import Study, run_study
from experiments.operator.console import Console
from experiments.report.choices import ReportRequest
from experiments.report.covariates import columns_tested
from experiments.report.progress import fitting
from experiments.session.store import iso_utc


@dataclass(frozen=True, slots=True)
class ReportedStudy:
    """A study with the data that depend on the source of its trials.

    Attributes:
        study: the study.
        title: heading of the page.
        subtitle: line below it.
        is_foreign: whether the trials come from another rig.
        trials: trials by terrain, for the study under other choices.
        with_columns: the same with the columns to test.
        cells: table of the cells of a matrix, if any.
        tables: further tables, each for its section.
        rig: health of the rig by trial.
        warnings: warnings at the top.
        numbers: further plain values for fits.json, by name.
    """

    study: Study
    title: str
    subtitle: str
    is_foreign: bool
    trials: Mapping[str, Iterable[RecordedTrial | TractionSeries]]
    with_columns: Mapping[str, Iterable[TractionSeries]]
    cells: Sequence[ReportTable] = ()
    tables: Sequence[ReportTable] = ()
    rig: Sequence[RigTrial] = ()
    warnings: Sequence[str] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict[str, Any])


def require_folder(out: Path) -> None:
    """Create the folder of a report, before anything is fitted.

    Raises:
        SettingsError: the folder cannot be created or written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(
            f"{out}: cannot be written ({error.strerror}).",
            hint="Name another folder: --to DIR. Nothing was fitted.",
        ) from error
    if not os.access(out, os.W_OK):
        raise SettingsError(
            f"{out}: cannot be written.",
            hint="Name another folder: --to DIR. Nothing was fitted.",
        )


def report_study(
    reported: ReportedStudy,
    out: Path,
    request: ReportRequest,
    console: Console,
    store: ResultStore | None = None,
) -> Path:
    """Write the page of a study, and return it.

    The first sections can be read while the study is repeated under other choices, its
    columns are tested and the remaining figures are drawn.

    Args:
        reported: the study.
        out: folder of the report.
        request: options of the report.
        console: output of progress.
        store: results of earlier runs; None = everything is computed.

    Raises:
        SettingsError: the folder cannot be written.
        MissingLibraryError: the extra `report` is not installed.
    """
    # slow to import, and not needed for exports
    from analysis.report.page import page_of, write_first_sections, write_report

    study = reported.study
    results = compute_results(study, reported.rig)
    context = ReportContext(
        title=reported.title,
        subtitle=reported.subtitle,
        is_simulated=study.simulated,
        is_foreign=reported.is_foreign,
        generated_utc=iso_utc(SystemClock().utc_ns()),
        tables=[*reported.cells, *reported.tables],
        warnings=reported.warnings,
        rig=reported.rig,
        with_pdf=request.with_pdf,
        results=results,
        store=store,
    )
    console.say("Drawing the paper's figures ...")
    first = write_first_sections(results, out, context)
    console.say(f"Summary and the paper's figures, to open now: {page_of(out)}")
    variants = request.choices.variants
    others = _repeat_study(study, reported.trials, variants, console, store)
    tested = columns_tested(
        study, reported.with_columns, request.covariates, console, store
    )
    console.say("Drawing the other figures ...")
    whole = replace(
        context,
        tables=[
            *reported.cells,
            *(comparison_table(choice, study, other) for choice, other in others),
            *covariate_tables(tested),
            *reported.tables,
        ],
        further_numbers={
            "what_if": [plain_choice(c, study, other) for c, other in others],
            "covariates": [result.numbers() for result in tested],
            **reported.numbers,
        },
    )
    return write_report(study, out, whole, first)


def _repeat_study(
    study: Study,
    trials: Mapping[str, Iterable[RecordedTrial | TractionSeries]],
    choices: Sequence[StudyVariant],
    console: Console,
    store: ResultStore | None = None,
) -> list[tuple[StudyVariant, Study]]:
    """Return a study of the same trials under each choice."""
    others: list[tuple[StudyVariant, Study]] = []
    for choice in choices:
        console.say(f"What if {choice.text}: fitting ...")
        series = {name: [choice.series(t) for t in ts] for name, ts in trials.items()}
        options = choice.options(study.options)
        with fitting(console) as progress:
            other = run_study(series, options, study.simulated, progress, store)
        others.append((choice.with_remark(chain(*trials.values())), other))
    return others
