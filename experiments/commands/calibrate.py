"""traction calibrate: guided calibrations of the rig."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.stage import Stage

EXAMPLES = """\
  traction calibrate gravity                what the arm weighs, with its tool
  traction calibrate gravity --fake --fast  the same steps with simulated devices"""

_WHAT = {"gravity": "gravity.toml"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `calibrate`."""
    parser.add_argument("what", choices=tuple(_WHAT), help="what is calibrated")
    parser.add_argument("--terrain", metavar="NAME", help="row of the matrix (first)")
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--fast", action="store_true", help="stepped time, only with --fake"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="where it is written (gravity.toml)"
    )
    parser.add_argument(
        "--poses", type=int, default=12, metavar="N", help="how many poses (12)"
    )
    parser.add_argument(
        "--force", action="store_true", help="accept a bad fit; the file says so"
    )


def run(args: argparse.Namespace) -> int:
    """Lead through one calibration and write its file; return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.bus_log import logging_bus
    from experiments.calibrating.guide import guided
    from experiments.company import Company, StopFlag, signals_ask
    from experiments.console import Console
    from experiments.messages import rest_text
    from experiments.operator import RehearsedHand, choose_keys
    from experiments.preflight import connect_rig, run_preflight
    from experiments.rigs import FakeOptions
    from experiments.settings import load_settings
    from experiments.stage import Stage
    from experiments.terminal import keyboard

    if args.fast and not args.fake:
        raise SettingsError("--fast works only with --fake.", hint="Nothing was done.")
    if not 3 <= args.poses <= 60:
        raise SettingsError(
            f"--poses {args.poses} - expected a whole number 3..60, e.g. 12.",
            hint="Nothing was started.",
        )
    settings = load_settings(args.config)
    row = settings.row(args.terrain or settings.matrix.terrains[0].name)
    out = args.out or Path(_WHAT[args.what])
    if out.exists():
        raise SettingsError(
            f"{out} exists and is never overwritten.",
            hint="Move it away or choose another name with --out. Nothing was started.",
        )
    console = Console(color=not args.no_color)
    keys = choose_keys(None, is_fake=args.fake)
    fake = FakeOptions(args.fast, seed=1) if args.fake else None
    rig = connect_rig(settings, row, fake)
    stop = StopFlag()
    with logging_bus(rig, None, console), signals_ask(stop), keyboard(keys):
        run_preflight(rig, Path(args.data), console)
        hand = RehearsedHand(rig.rehearsal) if rig.rehearsal else None
        stage = Stage(rig, Company(keys, console, stop, hand))
        try:
            return guided(
                stage, lambda: _gravity(stage, args.poses, out, is_forced=args.force)
            )
        finally:
            confirmed = stage.make_safe()
            console.say(rest_text(rig.crew.safety_mode(), is_confirmed=confirmed))


def _gravity(stage: Stage, poses: int, out: Path, *, is_forced: bool) -> None:
    from experiments.calibrating.gravity import GravityGuide
    from experiments.store import write_new_text
    from wam.gravity_file import gravity_to_toml

    found = GravityGuide(stage).run(poses, is_forced=is_forced)
    write_new_text(out, gravity_to_toml(found))
    stage.company.console.say(f"Written: {out}. To use it: [gravity] in rig.toml.")
