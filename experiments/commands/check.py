"""traction check: is the rig fit to run? The arm stays idle, no torque is sent."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.operator import Console

EXAMPLES = """\
  traction check --fake                     the page with simulated devices
  traction check --explain estop            more about a message"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `check`."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--fast", action="store_true", help="stepped time, only with --fake"
    )
    parser.add_argument(
        "--loop-test",
        type=float,
        default=5.0,
        metavar="SECONDS",
        help="how long the loop is measured (5)",
    )
    parser.add_argument("--terrain", metavar="NAME", help="row of the matrix (first)")
    parser.add_argument(
        "--config-only", action="store_true", help="check the settings, no device"
    )
    parser.add_argument(
        "--explain",
        metavar="NAME|all|states",
        help="more about a message; all of them; the tables of all states",
    )
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every CAN frame there"
    )


def run(args: argparse.Namespace) -> int:
    """Print the page and return the exit code."""
    from experiments.operator import GOOD, Console
    from experiments.preflight import connect_rig, run_preflight
    from experiments.rig import FakeOptions, logging_bus, read_gravity
    from experiments.settings import load_settings, origin_lines

    console = Console(color=not args.no_color)
    if args.explain:
        return _explain(args.explain, console)
    settings = load_settings(args.config)
    if args.config_only:
        read_gravity(settings)
        console.check(GOOD, "config", f"{settings.origin}")
        for line in origin_lines(settings):
            console.say(f"   {line}")
        return 0
    first = settings.matrix.terrains[0].name
    row = settings.row(args.terrain or first)
    fake = FakeOptions(args.fast, seed=1) if args.fake else None
    rig = connect_rig(settings, row, fake)
    console.say("traction check        " + ("SIMULATED" if fake else "LIVE RIG"))
    with logging_bus(rig, args.can_log, console):
        run_preflight(rig, Path(args.data), console, args.loop_test)
    console.say("Fit to run. No torque was sent.")
    return 0


def _explain(name: str, console: Console) -> int:
    from acquisition import SettingsError
    from acquisition.control_loop import transition_lines
    from experiments.messages import CATALOGUE, catalogue_table, explanation
    from experiments.session import table_lines

    pages = {
        "states": lambda: [*table_lines(), *transition_lines()],
        "all": catalogue_table,
    }
    if name not in pages and name not in CATALOGUE:
        raise SettingsError(
            f"There is no message called {name!r}.",
            hint=f"Known: states, all, {', '.join(sorted(CATALOGUE))}.",
        )
    for line in pages[name]() if name in pages else explanation(name):
        console.say(line)
    return 0
