"""traction teach: teach the location of a container by leading the arm."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import friction_share
from experiments.calibration.options import add_arm

if TYPE_CHECKING:
    from experiments.run.console_loop import ConsoleLoop

EXAMPLES = """\
  traction teach bay2 --config lab/rig.toml  put the sole down at both ends, three times
  traction teach bay2 --fake --fast          the same steps with simulated devices"""

_PLACE = re.compile(r"[a-z][a-z0-9_-]{0,23}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `teach`."""
    parser.add_argument("place", help="name of the place, e.g. bay2")
    parser.add_argument(
        "--foot", metavar="NAME", help="foot that is mounted (the first of rig.toml)"
    )
    add_arm(parser)
    parser.add_argument(
        "--to",
        type=Path,
        metavar="FILE",
        help="file that is written (place_NAME.toml beside rig.toml)",
    )


def run(args: argparse.Namespace) -> int:
    """Guide through the touches and write the place; returns the exit code."""
    from acquisition.errors import SettingsError
    from experiments.arguments import refuse_simulated_options
    from experiments.calibration.calibration import CalibrationContext, calibrate
    from experiments.calibration.guiding import check_new, guide_person
    from experiments.calibration.taught_place import place_calibration
    from experiments.settings.load import load_untaught

    refuse_simulated_options(args)
    friction_share(args)
    if not _PLACE.fullmatch(args.place):
        raise SettingsError(
            f"{args.place!r} is no name of a place.",
            hint="Small letters, digits, - and _, a letter first, e.g. bay2. Nothing "
            "was started.",
        )
    settings, row = load_untaught(args.config, args.place, args.foot)
    calibration = place_calibration(args.place)
    out = args.to or calibration.default_path(settings, row, is_fake=args.fake)
    check_new(out)

    def work(console_loop: ConsoleLoop) -> None:
        calibrate(calibration, CalibrationContext(console_loop), out)

    command, anew = f"traction teach {args.place}", calibration.made_anew
    return guide_person(args, settings, row, work, command, anew)
