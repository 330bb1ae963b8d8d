"""traction export: trials as tables, terrains as models, models for other programs."""

import argparse
from pathlib import Path

from experiments.arguments import add_allow_missing, add_seed

EXAMPLES = """\
  traction export S012 --to tables          kept trials of a session
  traction export --terrain-db terrains.json   all models of all sessions' terrains"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `export`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="S012 or a folder"
    )
    parser.add_argument(
        "--to", type=Path, metavar="DIR", help="into an empty or new folder"
    )
    add_allow_missing(parser)
    trials = parser.add_argument_group("trials: SESSION... --to DIR")
    trials.add_argument(
        "--format",
        choices=("csv", "parquet"),
        help="format of the tables (csv); parquet needs the extra traction[parquet]",
    )
    trials.add_argument(
        "--standard-rate",
        action="store_true",
        help="no tables, but MCAP files of the standard ROS 2 topics /joint_states, "
        "/wrench, /foot/pose and /foot/twist at the recorded 500 Hz",
    )
    models = parser.add_argument_group("models: [SESSION...] --terrain-db FILE")
    models.add_argument(
        "--terrain-db", type=Path, metavar="FILE", help="the terrain database, JSON"
    )
    add_seed(parser)


def run(args: argparse.Namespace) -> int:
    """Write what is asked for and return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console
    from experiments.report.choices import choose_sessions, tell_missing
    from experiments.report.export import export_sessions
    from experiments.report.sessions import ReportRequest, export_terrains
    from experiments.report.standard_topics import export_standard_topics
    from experiments.settings.load import load_settings

    if (args.to is None) == (args.terrain_db is None):
        raise SettingsError(
            "Export what: tables with --to DIR, or models with --terrain-db FILE?",
            hint="Name one of the two. Nothing was written.",
        )
    if args.standard_rate and (args.to is None or args.format):
        raise SettingsError(
            "--standard-rate writes recordings, neither tables nor models.",
            hint="Write: traction export SESSION --to DIR --standard-rate. "
            "Nothing was written.",
        )
    console = Console(color=not args.no_color)
    every = args.to is None and not args.sessions
    sessions = choose_sessions(args.data, args.sessions, every=every)
    tell_missing(sessions, console, allow_missing=args.allow_missing)
    if args.to is not None:
        if args.standard_rate:
            export_standard_topics(sessions, args.to, console)
        else:
            export_sessions(sessions, args.to, args.format or "csv", console)
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
