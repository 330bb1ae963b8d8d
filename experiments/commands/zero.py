"""traction zero: define the present position of the arm as home."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.operator.console import Console

EXAMPLES = """\
  traction zero                             asks, then defines the home position
  traction zero --fake --yes                the same steps with simulated devices"""

_CONFIRMATION = "home"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `zero`."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--yes", action="store_true", help="the arm is at home: do not ask"
    )


def run(args: argparse.Namespace) -> int:
    """Define the home position after confirmation; returns the exit code."""
    from experiments.calibration.zero import define_home
    from experiments.operator.console import Console
    from experiments.preflight.connecting import connect_rig
    from experiments.rig.rig import FakeOptions
    from experiments.settings.load import load_settings

    console = Console(color=not args.no_color, goes_on=True)
    settings = load_settings(args.config)
    fake = FakeOptions("fast", seed=1) if args.fake else None
    rig = connect_rig(settings, settings.matrix.terrains[0], fake)
    try:
        is_done = define_home(rig, console, lambda: args.yes or _is_confirmed(console))
    finally:
        rig.backend.close()
    return 0 if is_done else 5


def _is_confirmed(console: Console) -> bool:
    """Ask for the whole word: a stray Enter must not move the arm's zero."""
    from acquisition.errors import SettingsError

    if not sys.stdin.isatty():
        raise SettingsError(
            "Zeroing needs a person who confirms, and there is no terminal.",
            hint="Run it in a terminal, or add --yes. Nothing was changed.",
        )
    console.say(
        "Is the arm at home, folded against its stops, and held there? "
        f"Type {_CONFIRMATION} and Enter:"
    )
    return sys.stdin.readline().strip().lower() == _CONFIRMATION
