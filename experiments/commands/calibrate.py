"""traction calibrate: calibrate a part of the rig in guided steps."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import friction_share
from experiments.calibration.options import add_arm

if TYPE_CHECKING:
    from experiments.run.console_loop import ConsoleLoop
    from wam.model.constants import Array

EXAMPLES = """\
  traction calibrate terrain --terrain S10  where the container of a terrain stands
  traction calibrate sensor --fake --fast   the same steps with simulated devices"""

KINDS = {
    "gravity": "gravity of the arm",
    "friction": "friction of its drives",
    "sensor": "mounting and foot of the sensor",
    "foot": "another foot",
    "terrain": "frame of a container",
}
_MOST = 60  # poses


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `calibrate`."""
    parser.add_argument("what", choices=tuple(KINDS), help="; ".join(KINDS.values()))
    parser.add_argument(
        "--terrain",
        metavar="NAME",
        help="row of the matrix: its foot, its container (the first row)",
    )
    add_arm(parser)
    parser.add_argument(
        "--to",
        type=Path,
        metavar="FILE",
        help="file that is written (beside rig.toml)",
    )
    parser.add_argument(
        "--poses",
        type=int,
        default=12,
        metavar="N",
        help="number of poses (default 12)",
    )
    parser.add_argument(
        "--pose-file",
        type=Path,
        metavar="FILE",
        help="TOML file with the poses to use",
    )
    parser.add_argument(
        "--force", action="store_true", help="accept a fit that would be refused as bad"
    )


def run(args: argparse.Namespace) -> int:
    """Guide through one calibration and write its file; returns the exit code."""
    from experiments.arguments import refuse_simulated_options
    from experiments.calibration.calibration import CalibrationContext, calibrate
    from experiments.calibration.guiding import check_new, guide_person
    from experiments.calibration.kinds import CALIBRATIONS
    from experiments.calibration.pose_file import read_poses
    from experiments.settings.load import load_settings

    calibration, count = CALIBRATIONS[args.what], args.poses
    fewest = calibration.fewest_poses
    refuse_simulated_options(args)
    _check_count(count, fewest)
    friction_share(args)
    settings = load_settings(args.config)
    row = settings.row(args.terrain or settings.matrix.terrains[0].name)
    settings, row = calibration.bare(settings, row)
    out = args.to or calibration.default_path(settings, row, is_fake=args.fake)
    for path in calibration.files(out, is_fake=args.fake):
        check_new(path)
    poses: list[Array] = []
    if args.pose_file is not None:
        counts = range(fewest, _MOST + 1) if fewest else range(0)
        poses = read_poses(args.pose_file, settings, row, counts)

    def work(console_loop: ConsoleLoop) -> None:
        context = CalibrationContext(console_loop, count, poses, args.force)
        calibrate(calibration, context, out)

    command, anew = f"traction calibrate {args.what}", calibration.made_anew
    return guide_person(args, settings, row, work, command, anew)


def _check_count(count: int, fewest: int) -> None:
    from acquisition.errors import SettingsError

    if not fewest <= count <= _MOST:
        raise SettingsError(
            f"--poses {count} - expected a whole number {fewest}..{_MOST}, e.g. 12.",
            hint="Nothing was started.",
        )
