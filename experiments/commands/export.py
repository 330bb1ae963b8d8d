"""traction export and publish: recorded trials leave the data folder.

`export` writes tables, or terrains as one file of models; `publish` writes recordings,
tables and results together, with who made them and under which licence.
"""

import argparse
from pathlib import Path

from experiments.arguments import JoinedCommand, add_allow_missing, add_seed

EXAMPLES = """\
  traction export S012 --to tables          kept trials of a session
  traction export --terrain-db terrains.json   all models of all sessions' terrains"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `export`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="S012 or a folder"
    )
    parser.add_argument(
        "--to", type=Path, metavar="DIR", help="tables into an empty or new folder"
    )
    parser.add_argument(
        "--format",
        choices=("csv", "parquet"),
        default="csv",
        help="format of the tables (csv); parquet needs the extra traction[parquet]",
    )
    parser.add_argument(
        "--terrain-db", type=Path, metavar="FILE", help="the terrain database, JSON"
    )
    add_allow_missing(parser)
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Write the tables and return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console
    from experiments.report.choices import choose_sessions, tell_missing
    from experiments.report.export import export_sessions
    from experiments.report.sessions import ReportRequest, export_terrains
    from experiments.settings.load import load_settings

    if (args.to is None) == (args.terrain_db is None):
        raise SettingsError(
            "Export what: tables with --to DIR, or models with --terrain-db FILE?",
            hint="Name one of the two. Nothing was written.",
        )
    console = Console(color=not args.no_color)
    every = args.to is None and not args.sessions
    sessions = choose_sessions(args.data, args.sessions, every=every)
    tell_missing(sessions, console, allow_missing=args.allow_missing)
    if args.to is not None:
        export_sessions(sessions, args.to, args.format, console)
        return 0
    if args.terrain_db.exists():
        raise SettingsError(
            f"{args.terrain_db} exists and is never overwritten.",
            hint="Choose another name. Nothing was written.",
        )
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    wanted = ReportRequest(order, args.seed)
    export_terrains(sessions, args.data, args.terrain_db, wanted, console)
    return 0


_PUBLISH_EXAMPLES = """\
  traction publish S012 S013 --to crate --author "Family, Given" --licence CC-BY-4.0
  traction publish --all --to crate --author "Family, Given" --licence CC0-1.0"""
_LICENCES = ("CC-BY-4.0", "CC-BY-SA-4.0", "CC0-1.0", "ODC-By-1.0")


def _add_publish_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `publish`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session with trials")
    parser.add_argument(
        "--to", type=Path, required=True, metavar="DIR", help="an empty or new folder"
    )
    parser.add_argument(
        "--author",
        action="append",
        required=True,
        metavar="NAME",
        help='"Family, Given" or "Family, Given <ORCID>"; can be repeated',
    )
    parser.add_argument(
        "--licence", choices=_LICENCES, required=True, help="licence of the data"
    )
    parser.add_argument(
        "--title", default="", metavar="TEXT", help="title of the study"
    )
    parser.add_argument(
        "--description", default="", metavar="TEXT", help="a sentence or two"
    )
    add_allow_missing(parser)
    add_seed(parser)


def _publish(args: argparse.Namespace) -> int:
    """Write the publication and return the exit code."""
    from experiments.operator.console import Console
    from experiments.report.choices import choose_sessions, tell_missing
    from experiments.report.credits import LICENCES, parse_author
    from experiments.report.publication import PublishRequest, publish_sessions
    from experiments.report.sessions import ReportRequest
    from experiments.settings.load import load_settings

    authors = [parse_author(text) for text in args.author]
    request = PublishRequest(
        args.title, args.description, authors, LICENCES[args.licence]
    )
    console = Console(color=not args.no_color)
    sessions = choose_sessions(args.data, args.sessions, every=args.all)
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    missing = tell_missing(sessions, console, allow_missing=args.allow_missing)
    wanted = ReportRequest(order, args.seed, missing=missing)
    publish_sessions(sessions, args.data, args.to, wanted, request, console)
    return 0


PUBLISH = JoinedCommand(_PUBLISH_EXAMPLES, _add_publish_arguments, _publish)
