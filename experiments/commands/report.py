"""traction report: fit, compare and report recorded sessions."""

import argparse
from pathlib import Path

from experiments.arguments import add_allow_missing, add_analysis, add_seed

EXAMPLES = """\
  traction report S012                             one session, in its own folder
  traction report --all --what-if smoothing=25     the study under another choice"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `report`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session with trials")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="fit on the Dask cluster there: tls://HOST:PORT, or tcp://127.0.0.1:8786",
    )
    add_allow_missing(parser)
    add_seed(parser)
    add_analysis(parser)


def run(args: argparse.Namespace) -> int:
    """Write the report of one session or of a study."""
    from experiments.operator import Console
    from experiments.report import (
        ReportRequest,
        analysis_choices,
        choose_sessions,
        report_sessions,
        tell_missing,
    )
    from experiments.settings import load_settings

    choices = analysis_choices(args)
    console = Console(color=not args.no_color)
    data = Path(args.data)
    sessions = choose_sessions(data, args.sessions, every=args.all)
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    missing = tell_missing(sessions, console, allow_missing=args.allow_missing)
    wanted = ReportRequest(order, args.seed, args.scheduler, choices, missing)
    page = report_sessions(sessions, data, wanted, console)
    console.say(str(page))
    return 0
