"""traction fit: the analysis and the report for external data."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import (
    add_analysis_options,
    add_covariate_option,
    add_pdf_option,
    add_scheduler_option,
    add_seed_option,
    add_table_options,
)

if TYPE_CHECKING:
    from experiments.operator.console import Console

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
        help="folder of the report, empty or new",
    )
    add_table_options(parser)
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
    add_covariate_option(
        parser, "columns of every table, and travel (since the last drop of F_t)"
    )
    add_scheduler_option(parser)
    add_pdf_option(parser)
    add_seed_option(parser)
    add_analysis_options(parser)


def run(args: argparse.Namespace) -> int:
    """Fit tables and write the report."""
    from acquisition.extras import require_extra
    from experiments.operator.console import Console

    require_extra("report")  # before the page is imported
    if args.scheduler:
        require_extra("cluster")
    console = Console(color=not args.no_color)
    console.say("Reading the tables ...")
    from experiments.report.workers import workers_of_report

    with workers_of_report(are_needed=not args.scheduler):
        return _fit(args, console)


def _fit(args: argparse.Namespace, console: Console) -> int:
    from acquisition.errors import SettingsError
    from analysis.study.covariates import TRAVEL
    from analysis.tables.columns import parse_covariates, parse_inputs
    from experiments.named_tables import load_named_tables
    from experiments.report.choices import ReportRequest, analysis_choices
    from experiments.report.external_tables import report_tables_of_trials

    choices = analysis_choices(args)
    columns = () if args.covariate is None else parse_covariates(args.covariate)
    inputs = () if args.inputs is None else parse_inputs(args.inputs)
    request = ReportRequest(
        args.seed,
        scheduler=args.scheduler,
        choices=choices,
        covariates=columns,
        with_pdf=args.pdf,
    )
    if both := ", ".join(name for name in columns if name in inputs):
        raise SettingsError(
            f"--covariate and --inputs both name {both}.", hint="Leave one out."
        )
    trials = load_named_tables(args, args.files, inputs, args.stones)
    table_columns = [name for name in columns if name != TRAVEL]
    tested = trials
    if table_columns:
        further = (*inputs, *table_columns)
        tested = load_named_tables(args, args.files, further, args.stones)
    page = report_tables_of_trials(
        args.files, args.to, trials, tested, request, console
    )
    console.say(str(page))
    return 0
