"""traction export: trials as CSV tables with units and checksums."""

import argparse
from pathlib import Path

EXAMPLES = """\
  traction export S012 --to tables          kept trials of a session
  traction export S012 S013 --to tables     of several, one folder each"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `export`."""
    parser.add_argument(
        "sessions", nargs="+", metavar="SESSION", help="S012 or a folder"
    )
    parser.add_argument(
        "--to", type=Path, required=True, metavar="DIR", help="an empty or new folder"
    )


def run(args: argparse.Namespace) -> int:
    """Write the tables and return the exit code."""
    from experiments.console import Console
    from experiments.export import export_sessions
    from experiments.reporting import choose_sessions

    console = Console(color=not args.no_color)
    sessions = choose_sessions(args.data, args.sessions, every=False)
    export_sessions(sessions, args.to, console)
    return 0
