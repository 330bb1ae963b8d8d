"""traction calibrate: guided calibrations of the rig."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import friction_share
from experiments.calibration.options import add_arm

if TYPE_CHECKING:
    from experiments.run.console_loop import ConsoleLoop
    from experiments.settings.load import Settings
    from experiments.settings.matrix import TerrainRow
    from wam.model.constants import Array

EXAMPLES = """\
  traction calibrate terrain --terrain S10  where the container of a terrain stands
  traction calibrate sensor --fake --fast   the same steps with simulated devices"""

_MOST = 60  # poses


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `calibrate`."""
    parser.add_argument(
        "what",
        choices=tuple(_WORK),
        help="gravity of the arm; friction of its drives; mounting and "
        "foot of the sensor; another foot; frame of a container",
    )
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
        "--poses", type=int, default=12, metavar="N", help="number of poses (12)"
    )
    parser.add_argument(
        "--pose-file",
        type=Path,
        metavar="FILE",
        help="TOML file with the poses to use",
    )
    parser.add_argument(
        "--force", action="store_true", help="accept a fit that is refused as bad"
    )


def run(args: argparse.Namespace) -> int:
    """Lead through one calibration and write its file; return the exit code."""
    from experiments.calibration.guiding import check_new, guide_person
    from experiments.calibration.options import check_arm
    from experiments.settings.load import load_settings

    check_arm(args)
    _check_poses(args)
    friction_share(args)
    settings = load_settings(args.config)
    row = settings.row(args.terrain or settings.matrix.terrains[0].name)
    settings, row = _without_old(args.what, settings, row)
    out = args.to or _output_path(args.what, settings, row, is_fake=args.fake)
    for path in _written(args, out):
        check_new(path)
    args.chosen = _chosen_poses(args, settings, row)

    def work(console_loop: ConsoleLoop) -> None:
        _WORK[args.what](console_loop, args, out)

    command = f"traction calibrate {args.what}"
    return guide_person(
        args, settings, row, work, command, made_anew=_MADE_ANEW[args.what]
    )


def _gravity(console_loop: ConsoleLoop, args: argparse.Namespace, out: Path) -> None:
    from experiments.calibration.gravity import GravityGuide
    from experiments.session.data_files import write_new_text
    from wam.calibration.gravity_file import gravity_to_toml

    guide = GravityGuide(console_loop)
    result = guide.run(args.poses, args.chosen, is_forced=args.force)
    write_new_text(out, gravity_to_toml(result))
    _say_use(console_loop, out, _section("gravity", out), "rig.toml")


def _friction(console_loop: ConsoleLoop, args: argparse.Namespace, out: Path) -> None:
    from experiments.calibration.friction import FrictionGuide
    from experiments.session.data_files import write_new_text
    from wam.calibration.excitation import CENTRES
    from wam.calibration.friction_file import friction_to_toml, truth_to_toml
    from wam.model.friction import friction_of

    rig, console = console_loop.rig, console_loop.console
    console.say(f"Back and forth about {CENTRES} poses, each motor slow and fast.")
    guide = FrictionGuide(console_loop)
    result = guide.run(is_forced=args.force)
    write_new_text(out, friction_to_toml(result, rig.model.constants))
    _say_use(console_loop, out, _section("friction", out), "rig.toml")
    if rig.simulation is not None:
        true = friction_of(rig.simulation.friction())
        load_at = result.fit.friction.load_at
        text = truth_to_toml(true, load_at, rig.model.constants)
        write_new_text(_truth_path(out), text)
        where = f"True friction of the simulated arm: {_truth_path(out)}."
        console.say(where)


def _truth_path(out: Path) -> Path:
    return out.with_name(f"{out.name.split('.')[0]}.truth{out.suffix}")


def _written(args: argparse.Namespace, out: Path) -> list[Path]:
    """Return the files that the calibration will write."""
    is_true_known = args.what == "friction" and args.fake
    return [out, _truth_path(out)] if is_true_known else [out]


def _sensor(console_loop: ConsoleLoop, args: argparse.Namespace, out: Path) -> None:
    from experiments.calibration.sensor import SensorGuide
    from experiments.session.data_files import write_new_text
    from ft_sensor.calibration.sensor_file import sensor_to_toml

    tool = console_loop.rig.model.tool
    assert tool is not None
    is_foot = args.what == "foot"
    mounting = (tool.sensor_angle, tool.sensor_sign) if is_foot else None
    guide = SensorGuide(console_loop)
    result = guide.run(args.poses, mounting, args.chosen, is_forced=args.force)
    write_new_text(out, sensor_to_toml(result))
    section = f"feet.{result.foot}" if is_foot else "ft_sensor"
    _say_use(
        console_loop, out, f'calibration = "{out.name}" in [{section}]', "rig.toml"
    )


def _terrain(console_loop: ConsoleLoop, args: argparse.Namespace, out: Path) -> None:
    from experiments.calibration.terrain import TerrainGuide
    from experiments.session.data_files import write_new_text
    from experiments.session.store import iso_utc
    from experiments.settings.calibrations import FORCED
    from ft_sensor.calibration.files import terrain_to_toml
    from ft_sensor.calibration.fit import is_inclined_otherwise

    rig = console_loop.rig
    fit, points = TerrainGuide(console_loop).run(is_forced=args.force)
    fields = {
        "simulated": str(rig.is_simulated).lower(),
        FORCED: str(is_inclined_otherwise(fit, rig.frame)).lower(),
        "measured_utc": iso_utc(rig.clock.utc_ns()),
        "residual": f"{fit.residual:.6f}",
        "roll": f"{fit.roll:.6f}",
        "points": str([point.tolist() for point in points]),
    }
    write_new_text(out, terrain_to_toml(rig.row.name, fit.frame, fields))
    line = f'calibration = "{out.name}" in the row of {rig.row.name}'
    _say_use(console_loop, out, line, "matrix.toml")


def _section(name: str, out: Path) -> str:
    return f'[{name}] model = "calibrated", file = "{out.name}"'


def _say_use(console_loop: ConsoleLoop, out: Path, line: str, file: str) -> None:
    console_loop.console.say(f"Written: {out}. To use it: {line} of {file}.")


_WORK = {
    "gravity": _gravity,
    "friction": _friction,
    "sensor": _sensor,
    "foot": _sensor,
    "terrain": _terrain,
}
# What of a commissioning each measures anew; all of them let the arm float or move it.
_MADE_ANEW = {
    "gravity": ("[gravity]", "[friction]"),
    "friction": ("[friction]",),
    "sensor": ("[ft_sensor]", "[feet]"),
    "foot": ("[feet]",),
    "terrain": (),
}
_FEWEST = {"gravity": 3, "sensor": 6, "foot": 6}  # poses


def _without_old(
    what: str, settings: Settings, row: TerrainRow
) -> tuple[Settings, TerrainRow]:
    """Return settings and row without the calibration that is made anew."""
    if what == "gravity":
        return settings.by_cad().without_friction(), row
    if what == "friction":
        return settings.without_friction(), row
    if what == "terrain":
        bare = row.as_container().model_copy(update={"calibration": None})
        return settings.with_row(bare), bare
    return settings.without_sensor(row.foot, is_mounted=what == "foot"), row


def _output_path(
    what: str, settings: Settings, row: TerrainRow, *, is_fake: bool
) -> Path:
    """Return where the file goes, beside rig.toml; what is simulated is marked."""
    from experiments.rig.law_calibrations import friction_path, gravity_path

    names = {
        "sensor": "ft_sensor.toml",
        "foot": f"foot_{row.foot}.toml",
        "terrain": f"terrain_{row.name}.toml",
    }
    law_paths = {"gravity": gravity_path, "friction": friction_path}
    law_path = law_paths.get(what)
    path = law_path(settings) if law_path else settings.folder / names[what]
    if not is_fake or path.stem.endswith(".fake"):
        return path
    return path.with_name(f"{path.stem}.fake{path.suffix}")


def _check_poses(args: argparse.Namespace) -> None:
    from acquisition.errors import SettingsError

    fewest = _FEWEST.get(args.what, 0)
    if not fewest <= args.poses <= _MOST:
        raise SettingsError(
            f"--poses {args.poses} - expected a whole number {fewest}..{_MOST}, "
            "e.g. 12.",
            hint="Nothing was started.",
        )


def _chosen_poses(
    args: argparse.Namespace, settings: Settings, row: TerrainRow
) -> list[Array]:
    """Return the poses of a person, checked before anything is started; [] = none."""
    if args.pose_file is None:
        return []
    from experiments.calibration.pose_file import read_poses

    fewest = _FEWEST.get(args.what)
    counts = range(0) if fewest is None else range(fewest, _MOST + 1)
    return read_poses(args.pose_file, settings, row, counts)
