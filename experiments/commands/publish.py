"""traction publish: recordings, tables and results together, for an archive."""

import argparse
from pathlib import Path

from experiments.arguments import add_allow_missing_option, add_seed_option

EXAMPLES = """\
  traction publish S012 S013 --to crate --author "Family, Given" --licence CC-BY-4.0
  traction publish --all --to crate --author "Family, Given" --licence CC0-1.0"""

_LICENCES = ("CC-BY-4.0", "CC-BY-SA-4.0", "CC0-1.0", "ODC-By-1.0")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `publish`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session with trials")
    parser.add_argument(
        "--to", type=Path, required=True, metavar="DIR", help="new or empty folder"
    )
    parser.add_argument(
        "--author",
        action="append",
        required=True,
        metavar="NAME",
        help='"Family, Given", "Family, Given <ORCID>" or the name of an '
        "organisation; can be repeated",
    )
    parser.add_argument(
        "--licence", choices=_LICENCES, required=True, help="licence of the data"
    )
    parser.add_argument(
        "--title", default="", metavar="TEXT", help="title of the study"
    )
    parser.add_argument(
        "--description", default="", metavar="TEXT", help="description of the study"
    )
    add_allow_missing_option(parser)
    add_seed_option(parser)


def run(args: argparse.Namespace) -> int:
    """Write the publication; returns the exit code."""
    from experiments.operator.console import Console

    console = Console(color=not args.no_color)
    console.say("Reading the trials ...")  # slow to import and to read
    from experiments.export.credits import LICENCES, parse_author
    from experiments.export.publication import PublishRequest, publish_sessions
    from experiments.report.choices import ReportRequest
    from experiments.report.chosen_sessions import choose_sessions, report_missing
    from experiments.settings.load import load_settings

    authors = [parse_author(text) for text in args.author]
    request = PublishRequest(
        args.title, args.description, authors, LICENCES[args.licence]
    )
    sessions = choose_sessions(args.data, args.sessions, every=args.all)
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    missing = report_missing(sessions, console, allow_missing=args.allow_missing)
    wanted = ReportRequest(args.seed, order, missing=missing)
    publish_sessions(sessions, args.data, args.to, wanted, request, console)
    return 0
