"""traction fit: the analysis and the report for external data."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import (
    add_analysis,
    add_covariate,
    add_pdf,
    add_scheduler,
    add_seed,
    add_table_form,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from analysis.data.series import TractionSeries
    from analysis.report.section import ReportTable

EXAMPLES = """\
  traction fit trials.npz --to fit
  traction fit a.csv b.csv --to fit --columns t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `fit`."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="npz, a CSV or Parquet file per trial, or a folder of traction export",
    )
    parser.add_argument(
        "--to",
        required=True,
        type=Path,
        metavar="DIR",
        help="folder of the report",
    )
    add_table_form(parser)
    parser.add_argument(
        "--stones",
        metavar="NAME=SIZE,..",
        help="stones of a terrain: small, big or none for a plate",
    )
    parser.add_argument(
        "--inputs",
        metavar="v_t,F_n,..",
        help="inputs of the models: v_t, F_n and further columns of numbers in every "
        "table, e.g. an angle",
    )
    add_covariate(parser, "columns of every table, and way, since the last drop of F_t")
    add_scheduler(parser)
    add_pdf(parser)
    add_seed(parser)
    add_analysis(parser)


def run(args: argparse.Namespace) -> int:
    """Fit tables and write the report."""
    from acquisition.clock import SystemClock
    from acquisition.errors import SettingsError
    from acquisition.extras import require_extra

    require_extra("report")  # before its page is imported
    if args.scheduler:
        require_extra("cluster")
    from experiments.report.workers import start_workers

    start_workers(args.scheduler)
    from analysis.dialects.columns import parse_covariates, parse_inputs
    from analysis.report.page import ReportContext, write_report
    from analysis.report.results import compute_results
    from analysis.report.sections.beyond_paper.further_columns import covariate_tables
    from analysis.report.sections.sensitivity import plain_choice, side_by_side
    from analysis.report.whole_study import run_whole_study
    from analysis.study.covariates import WAY
    from analysis.study.models import FitOptions
    from analysis.study.study import StudyOptions, notes_of_tables
    from experiments.operator.console import Console
    from experiments.report.choices import analysis_choices, repeat_study
    from experiments.report.covariates import columns_tested
    from experiments.report.progress import fitting
    from experiments.report.sessions import require_samples
    from experiments.session.store import iso_utc

    console = Console(color=not args.no_color)
    choices = analysis_choices(args)
    columns = () if args.covariate is None else parse_covariates(args.covariate)
    inputs = () if args.inputs is None else parse_inputs(args.inputs)
    if both := ", ".join(name for name in columns if name in inputs):
        raise SettingsError(
            f"--covariate and --inputs both name {both}.", hint="Leave one out."
        )
    trials = _load(args, inputs)
    beside = [name for name in columns if name != WAY]
    tested = _load(args, (*inputs, *beside)) if beside else trials
    for choice in choices.variants:  # refused before anything is fitted
        choice.series(next(iter(trials.values()))[0])
    is_simulated = _is_simulated(trials)
    _refuse_repeated(trials)
    told = notes_of_tables(trials)
    for note in told:  # before the work: a wrong unit shows here
        console.say(f"▲ {note}")
    count = sum(len(series) for series in trials.values())
    console.say(f"{count} trials on {len(trials)} terrains: fitting ...")
    fit = FitOptions(bounds=choices.bounds, seed=args.seed, models=choices.models)
    options = StudyOptions(choices.prepare, fit=fit, scheduler=args.scheduler)
    with fitting(console) as progress:
        study, break_away = run_whole_study(trials, options, is_simulated, progress)
    require_samples(study)
    others = repeat_study(study, trials, choices.variants, console)
    found = columns_tested(study, tested, columns, console)
    context = ReportContext(
        "Traction from external data",
        f"{count} trials from {len(args.files)} files",
        is_simulated=study.simulated,
        is_foreign=True,
        generated_utc=iso_utc(SystemClock().utc_ns()),
        tables=[
            *(side_by_side(choice, study, other) for choice, other in others),
            *covariate_tables(found),
            *_import_tables(args.files),
        ],
        further_numbers={
            "what_if": [plain_choice(c, study, other) for c, other in others],
            "covariates": [one.numbers() for one in found],
        },
        with_pdf=args.pdf,
        results=compute_results(study, break_away=break_away),
    )
    page = write_report(study, args.to, context)
    for note in study.groups:
        console.say(note)
    for warning in study.warnings:
        if warning not in told:
            console.say(f"▲ {warning}")
    console.say(str(page))
    return 0


def _load(
    args: argparse.Namespace, inputs: Sequence[str]
) -> dict[str, list[TractionSeries]]:
    """Return the trials by terrain, with further columns; raises SettingsError."""
    from analysis.data.tables import load_tables
    from analysis.data.terrain_kinds import parse_stones
    from analysis.dialects.columns import (
        parse_columns,
        parse_names,
        parse_units,
    )

    columns = parse_columns(args.columns) if args.columns else None
    stones = parse_stones(args.stones) if args.stones else None
    units = parse_units(args.unit) if args.unit else None
    return load_tables(
        args.files,
        columns,
        args.terrain,
        stones,
        units,
        args.rate,
        negate=parse_names(args.negate) if args.negate else (),
        decimal=args.decimal,
        inputs=inputs,
    )


def _import_tables(files: Sequence[Path]) -> list[ReportTable]:
    """Return what the folders of imported trials tell of themselves."""
    from analysis.imported.record import read_record
    from analysis.report.sections.imported import import_tables

    folders = dict.fromkeys(path if path.is_dir() else path.parent for path in files)
    records = [read_record(folder) for folder in folders]
    return [t for record in records if record for t in import_tables(record)]


def _refuse_repeated(trials: Mapping[str, Sequence[TractionSeries]]) -> None:
    """Refuse a trial that is there twice: left out, it would be fitted all the same."""
    from hashlib import blake2b

    from acquisition.errors import SettingsError

    first: dict[bytes, str] = {}
    for series in (one for group in trials.values() for one in group):
        digest = blake2b()
        for column in (series.t - series.t[0], series.v_t, series.F_n, series.F_t):
            digest.update(column.tobytes())
        name = f"{series.terrain} {series.name}"
        original = first.setdefault(digest.digest(), name)
        if original is not name:
            raise SettingsError(
                f"{name} holds the same trial as {original}.",
                hint="Give each trial once.",
            )


def _is_simulated(trials: Mapping[str, Sequence[TractionSeries]]) -> bool:
    """Return whether the trials are simulated ones; a mixture is refused."""
    from acquisition.errors import SettingsError

    kinds = {trial.is_simulated for series in trials.values() for trial in series}
    if len(kinds) > 1:
        raise SettingsError(
            "A report cannot mix simulated and recorded trials.",
            hint="Give the tables of one kind only.",
        )
    return True in kinds
