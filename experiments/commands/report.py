"""traction report: fit, compare and report recorded sessions."""

import argparse
from pathlib import Path

from experiments.arguments import add_seed

EXAMPLES = """\
  traction report S012                      one session, into its own folder
  traction report --all                     the study of all sessions"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `report`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session with trials")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="fit on the Dask cluster there, e.g. tcp://192.168.1.5:8786",
    )
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Write the report of one session or of a study."""
    from experiments.console import Console
    from experiments.reporting import Order, choose_sessions, report_sessions
    from experiments.settings import load_settings

    console = Console(color=not args.no_color)
    data = Path(args.data)
    sessions = choose_sessions(data, args.sessions, every=args.all)
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    wanted = Order(order, args.seed, args.scheduler)
    page = report_sessions(sessions, data, wanted, console)
    console.say(str(page))
    return 0
