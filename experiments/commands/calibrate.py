"""traction calibrate: guided calibrations of the rig."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.settings import Settings
    from experiments.stage import Stage

EXAMPLES = """\
  traction calibrate gravity                what the arm weighs, with its tool
  traction calibrate gravity --fake --fast  the same steps with simulated devices"""

_FEWEST, _MOST = 3, 60  # poses


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `calibrate`."""
    parser.add_argument("what", choices=tuple(_WORK), help="what is calibrated")
    parser.add_argument(
        "--terrain", metavar="NAME", help="row of the matrix, for its foot (first)"
    )
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--fast", action="store_true", help="stepped time, only with --fake"
    )
    parser.add_argument(
        "--operator-script", metavar="auto", help="who answers, only with --fake"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="where it is written (beside rig.toml)"
    )
    parser.add_argument(
        "--poses", type=int, default=12, metavar="N", help="how many poses (12)"
    )
    parser.add_argument(
        "--force", action="store_true", help="accept a fit that is refused as bad"
    )


def run(args: argparse.Namespace) -> int:
    """Lead through one calibration and write its file; return the exit code."""
    from experiments.bus_log import logging_bus
    from experiments.calibrating.guide import guided
    from experiments.company import Company, StopFlag, signals_ask
    from experiments.console import Console
    from experiments.operator import RehearsedHand, choose_keys
    from experiments.preflight import connect_rig, run_preflight
    from experiments.rigs import FakeOptions
    from experiments.settings import load_settings
    from experiments.stage import Stage
    from experiments.terminal import keyboard

    _check_arguments(args)
    settings = load_settings(args.config).by_cad()
    row = settings.row(args.terrain or settings.matrix.terrains[0].name)
    out = args.out or _place(settings, is_fake=args.fake)
    _check_out(out)
    console = Console(color=not args.no_color)
    keys = choose_keys(args.operator_script, is_fake=args.fake)
    fake = FakeOptions(args.fast, seed=1) if args.fake else None
    rig = connect_rig(settings, row, fake)
    kind = "SIMULATED" if rig.is_simulated else "LIVE RIG"
    console.say(f"traction calibrate {args.what}        {kind} · foot {row.foot}")
    stop = StopFlag()
    with logging_bus(rig, None, console), signals_ask(stop), keyboard(keys):
        run_preflight(rig, Path(args.data), console)
        hand = RehearsedHand(rig.rehearsal) if rig.rehearsal else None
        stage = Stage(rig, Company(keys, console, stop, hand))
        return guided(stage, lambda: _WORK[args.what](stage, args, out))


def _gravity(stage: Stage, args: argparse.Namespace, out: Path) -> None:
    from experiments.calibrating.gravity import GravityGuide
    from experiments.store import write_new_text
    from wam.gravity_file import gravity_to_toml

    found = GravityGuide(stage).run(args.poses, is_forced=args.force)
    write_new_text(out, gravity_to_toml(found))
    stage.company.console.say(
        f'Written: {out}. To use it: [gravity] model = "calibrated" in rig.toml.'
    )


_WORK = {"gravity": _gravity}


def _place(settings: Settings, *, is_fake: bool) -> Path:
    """Return where rig.toml expects the file; what is simulated is marked."""
    from experiments.gravity_choice import gravity_path

    path = gravity_path(settings)
    return path.with_name(f"{path.stem}.fake{path.suffix}") if is_fake else path


def _check_arguments(args: argparse.Namespace) -> None:
    from acquisition.errors import SettingsError

    nothing = "Nothing was started."
    if not args.fake and (args.fast or args.operator_script):
        raise SettingsError(
            "--fast and --operator-script work only with --fake.", hint=nothing
        )
    if not _FEWEST <= args.poses <= _MOST:
        raise SettingsError(
            f"--poses {args.poses} - expected a whole number {_FEWEST}..{_MOST}, "
            "e.g. 12.",
            hint=nothing,
        )


def _check_out(out: Path) -> None:
    """Refuse before the arm moves what could not be written afterwards."""
    from acquisition.errors import SettingsError

    if out.exists():
        raise SettingsError(
            f"{out} exists and is never overwritten.",
            hint="Move it away or choose another name with --out. Nothing was started.",
        )
    if not out.parent.is_dir():
        raise SettingsError(
            f"There is no folder {out.parent} for the calibration.",
            hint="Make it, or choose another name with --out. Nothing was started.",
        )
