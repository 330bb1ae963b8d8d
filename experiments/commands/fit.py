"""traction fit: the analysis and the report for tables from elsewhere."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import add_seed

if TYPE_CHECKING:
    from analysis.study import Study

EXAMPLES = """\
  traction fit trials.npz --out fit
  traction fit a.csv b.csv --out fit --columns t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `fit`."""
    parser.add_argument(
        "files", nargs="+", type=Path, metavar="FILE", help="npz, or CSV per trial"
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder of the report"
    )
    parser.add_argument(
        "--columns", metavar="t=..,v_t=..,F_n=..,F_t=..", help="names in a CSV"
    )
    parser.add_argument(
        "--unit", metavar="v_t=mm/s,..", help="units where a header gives none"
    )
    parser.add_argument("--terrain", metavar="NAME", help="terrain of the CSV files")
    parser.add_argument(
        "--stones",
        metavar="NAME=SIZE,..",
        help="stones of a terrain: small, big or none for a plate",
    )
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Fit tables and write the report."""
    from acquisition import SystemClock
    from analysis.data import (
        PrepareOptions,
        load_tables,
        parse_columns,
        parse_stones,
        parse_units,
    )
    from analysis.report import ReportContext, write_report
    from analysis.study import FitOptions, StudyOptions, run_study
    from experiments.operator import Console
    from experiments.report import REPORTED, fitting
    from experiments.session import iso_utc

    console = Console(color=not args.no_color)
    columns = parse_columns(args.columns) if args.columns else None
    stones = parse_stones(args.stones) if args.stones else None
    units = parse_units(args.unit) if args.unit else None
    trials = load_tables(args.files, columns, args.terrain, stones, units)
    count = sum(len(series) for series in trials.values())
    console.say(f"{count} trials on {len(trials)} terrains: fitting ...")
    fit = FitOptions(seed=args.seed, models=REPORTED)
    options = StudyOptions(prepare=PrepareOptions(), fit=fit)
    with fitting(console) as progress:
        study = run_study(trials, options, simulated=False, progress=progress)
    _require_samples(study)
    context = ReportContext(
        title="Traction of foreign tables",
        subtitle=f"{count} trials from {len(args.files)} files",
        is_simulated=False,
        is_foreign=True,
        generated_utc=iso_utc(SystemClock().utc_ns()),
    )
    page = write_report(study, args.out, context)
    for warning in study.warnings:
        console.say(f"▲ {warning}")
    console.say(str(page))
    return 0


def _require_samples(study: Study) -> None:
    """Refuse tables of which nothing is left to fit.

    Raises:
        SettingsError: no terrain has a sample inside the window.
    """
    from acquisition import SettingsError

    if any(result.kept for result in study.terrains.values()):
        return
    prepare = study.options.prepare
    raise SettingsError(
        "No sample is left to fit: none moves forward at "
        f"{prepare.slowest:g} to {prepare.fastest:g} m/s.",
        hint=" ".join(study.warnings) or "Check the columns and their units.",
    )
