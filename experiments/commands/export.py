"""traction export: trials as tables, terrains as models, models for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import add_allow_missing_option, add_seed_option

if TYPE_CHECKING:
    from experiments.operator.console import Console

EXAMPLES = """\
  traction export S012 --to tables          kept trials of a session
  traction export --terrain-db terrains.json --for c,onnx --to controller"""

_NOTHING = "Nothing was written."
# Options of one use only; None or False if not given.
_OF_TRIALS = ("format", "standard_rate")
_OF_TARGETS = ("terrain", "model", "float")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `export`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="S012 or a folder"
    )
    parser.add_argument("--to", type=Path, metavar="DIR", help="new or empty folder")
    add_allow_missing_option(parser)
    add_seed_option(parser)
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
        "--terrain-db",
        type=Path,
        metavar="FILE",
        help="terrain database (JSON): written, or read if --for is given",
    )
    _add_targets(parser)


def _add_targets(parser: argparse.ArgumentParser) -> None:
    from analysis.terrains.export.names import target_names

    group = parser.add_argument_group(
        "terrains for other programs: --terrain-db FILE --for NAME,.. --to DIR"
    )
    group.add_argument(
        "--for",
        dest="targets",
        metavar="NAME,..",
        help=f"formats of controllers: {', '.join(target_names())}",
    )
    group.add_argument(
        "--terrain", metavar="NAME,..", help="terrains of the database (default all)"
    )
    group.add_argument(
        "--model", metavar="NAME", help="model of the database (its default)"
    )
    group.add_argument(
        "--float", action="store_true", help="single precision in C (default double)"
    )


def run(args: argparse.Namespace) -> int:
    """Write the export; returns the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console

    _check_use(args)
    console = Console(color=not args.no_color)
    if args.targets is not None:
        return _export_for(args, console)
    if (args.to is None) == (args.terrain_db is None):
        raise SettingsError(
            "Export what: tables with --to DIR, models with --terrain-db FILE, or "
            "models for other programs with both and --for NAME,..?",
            hint=f"Name one of the three. {_NOTHING}",
        )
    console.say("Reading the trials ...")
    return _export_sessions(args, console)


def _check_use(args: argparse.Namespace) -> None:
    """Refuse options of another use of the command.

    Raises:
        SettingsError: there are such options, or a required one is missing.
    """
    from acquisition.errors import SettingsError

    def given(names: tuple[str, ...]) -> str:
        named = [name for name in names if _is_given(args, name)]
        return ", ".join(f"--{name.replace('_', '-')}" for name in named)

    if args.targets is None:
        if options := given(_OF_TARGETS):
            raise SettingsError(
                f"{options}: only terrains for other programs have that.",
                hint="Write: traction export --terrain-db FILE --for NAME,.. --to DIR. "
                f"{_NOTHING}",
            )
        if (options := given(_OF_TRIALS)) and args.terrain_db is not None:
            raise SettingsError(
                f"{options}: only trials have that.",
                hint=f"Write: traction export SESSION --to DIR. {_NOTHING}",
            )
        if args.standard_rate and args.format:
            raise SettingsError(
                "--standard-rate writes recordings, --format tables.",
                hint=f"Leave one of them out. {_NOTHING}",
            )
        return
    if options := given((*_OF_TRIALS, "allow_missing")):
        raise SettingsError(
            f"{options}: only trials have that; --for exports terrains of a database.",
            hint=f"Leave them out. {_NOTHING}",
        )
    if args.sessions:
        raise SettingsError(
            f"--for exports terrains of a database, not {' '.join(args.sessions):.80}.",
            hint="Make a database of the sessions first: traction export "
            f"{' '.join(args.sessions):.80} --terrain-db FILE. {_NOTHING}",
        )
    if args.terrain_db is None or args.to is None:
        raise SettingsError(
            "--for needs the database to read and the folder to write.",
            hint="Write: traction export --terrain-db FILE --for "
            f"{args.targets:.80} --to DIR. {_NOTHING}",
        )


def _is_given(args: argparse.Namespace, name: str) -> bool:
    value = getattr(args, name)
    return value is not None and value is not False


def _export_for(args: argparse.Namespace, console: Console) -> int:
    from acquisition.errors import SettingsError
    from analysis.terrains.export.folder import parse_targets
    from experiments.export.terrain_targets import TargetRequest, export_for

    targets, names = parse_targets(args.targets), _names(args.terrain)
    if args.terrain is not None and not names:
        raise SettingsError(
            f"--terrain {args.terrain:.80} names no terrain.",
            hint=f"Leave it out for all of them. {_NOTHING}",
        )
    if args.float and "c" not in targets:
        raise SettingsError(
            "--float is for c, which is not in --for.",
            hint=f"Leave it out, or add c. {_NOTHING}",
        )
    request = TargetRequest(
        database=args.terrain_db,
        targets=targets,
        to=args.to,
        terrains=names,
        model=args.model or "",
        is_float=args.float,
    )
    export_for(request, console)
    return 0


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(name.strip() for name in (text or "").split(",") if name.strip())


def _export_sessions(args: argparse.Namespace, console: Console) -> int:
    from acquisition.errors import SettingsError
    from experiments.export.standard_topics import export_standard_topics
    from experiments.export.terrain_database import export_terrains
    from experiments.export.trial_tables import export_sessions
    from experiments.report.choices import ReportRequest
    from experiments.report.chosen_sessions import choose_sessions, report_missing
    from experiments.settings.load import load_settings

    every = args.to is None and not args.sessions
    sessions = choose_sessions(args.data, args.sessions, every=every)
    report_missing(sessions, console, allow_missing=args.allow_missing)
    if args.to is not None:
        if args.standard_rate:
            export_standard_topics(sessions, args.to, console)
        else:
            export_sessions(sessions, args.to, args.format or "csv", console)
        return 0
    if args.terrain_db.exists():
        raise SettingsError(
            f"{args.terrain_db} exists and is never overwritten.",
            hint=f"Choose another name. {_NOTHING}",
        )
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    wanted = ReportRequest(args.seed, order)
    export_terrains(sessions, args.data, args.terrain_db, wanted, console)
    return 0
