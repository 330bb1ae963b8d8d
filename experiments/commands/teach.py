"""traction teach: teach by hand where a container stands."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import friction_share
from experiments.calibration.options import add_arm

if TYPE_CHECKING:
    from experiments.calibration.place import TaughtEnds
    from experiments.run.console_loop import ConsoleLoop
    from experiments.settings.matrix import TerrainRow

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
    """Lead through the touches and write the place; return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.calibration.guiding import check_new, guide_person
    from experiments.calibration.options import check_arm
    from experiments.settings.load import load_unplaced

    check_arm(args)
    friction_share(args)
    if not _PLACE.fullmatch(args.place):
        raise SettingsError(
            f"{args.place!r} is no name of a place.",
            hint="Small letters, digits, - and _, a letter first, e.g. bay2. Nothing "
            "was started.",
        )
    settings, row = load_unplaced(args.config, args.place, args.foot)
    fake = ".fake" if args.fake else ""
    out = args.to or settings.folder / f"place_{args.place}{fake}.toml"
    check_new(out)

    def work(console_loop: ConsoleLoop) -> None:
        _teach(console_loop, args.place, out, row)

    return guide_person(args, settings, row, work, f"traction teach {args.place}", ())


def _teach(console_loop: ConsoleLoop, place: str, out: Path, row: TerrainRow) -> None:
    from experiments.calibration.place import PlaceGuide
    from experiments.session.data_files import write_new_text

    ends = PlaceGuide(console_loop).run()
    text = _place_text(console_loop, place, ends, row)
    write_new_text(out, text)
    console_loop.console.say(
        f'Written: {out}. To use it: [places.{place}] taught = "{out.name}" of '
        f'rig.toml, and place = "{place}" of a cell.'
    )


def _place_text(
    console_loop: ConsoleLoop, place: str, ends: TaughtEnds, row: TerrainRow
) -> str:
    """Return the file of a place; says what was found."""
    import numpy as np

    from experiments.session.store import iso_utc
    from experiments.settings.places import TaughtPlace

    rig = console_loop.rig
    x, y, z = (round(value, 4) for value in ends.far.tolist())
    angles = [round(float(np.degrees(a)), 2) for a in (ends.heading, ends.incline)]
    taught = TaughtPlace(
        place=place,
        far_end=(x, y, z),
        heading_deg=angles[0],
        incline_deg=angles[1],
        travel=round(ends.travel, 4),
        start=tuple(round(value, 4) for value in ends.start.tolist()),
        foot=row.foot,
        arm=rig.serials or (),
        measured_utc=iso_utc(rig.clock.utc_ns()),
        simulated=rig.is_simulated,
        spread_mm=round(1e3 * ends.spread, 2),
    )
    console_loop.console.say(
        f"far end {x:.3f}, {y:.3f}, {z:.3f} m, travel {taught.travel:.3f} m, heading "
        f"{angles[0]:.1f} degrees, incline {angles[1]:+z.1f} degrees (to about 1; "
        f"traction calibrate terrain is exact); touches within "
        f"{taught.spread_mm:.1f} mm"
    )
    return taught.text("Taught by hand; m, rad, base frame of the arm.")
