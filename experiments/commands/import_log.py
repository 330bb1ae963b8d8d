"""traction import: trials from the log of another robot and its URDF."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import number_within

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from analysis.data.terrain_kinds import Value
    from analysis.logs.request import ImportRequest, Tare

EXAMPLES = """\
  traction import log.mcap --urdf robot.urdf --list         topics, rates, links
  traction import log.mcap --urdf robot.urdf --foot foot --sensor ft_frame
      --acts ground-on-foot --list          a command line to be read and edited"""
_NEEDED = (
    "to",
    "urdf",
    "foot",
    "sensor",
    "acts",
    "tare",
    "tool-mass",
    "along",
    "normal",
    "lag",
    "trials",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `import`."""
    parser.add_argument(
        "log",
        type=Path,
        metavar="LOG",
        help=".mcap file, .db3 file or folder of rosbag2, or ROS 1 .bag file",
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="list the contents of log and URDF; with --foot, --sensor and --acts also "
        "a complete command line with the values estimated from the log",
    )
    parser.add_argument(
        "--to", type=Path, metavar="DIR", help="new folder of the tables"
    )
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="URDF of the robot")
    _add_wrench(parser)
    _add_ground(parser)
    parser.add_argument(
        "--joints", metavar="TOPIC", help="topic of the joints, if there are several"
    )
    parser.add_argument(
        "--clock",
        choices=("stamp", "receipt"),
        help="clock to use if sender and recorder disagree",
    )
    parser.add_argument(
        "--trials",
        metavar="T0:T1,..",
        help="seconds of the log, one interval per trial",
    )
    parser.add_argument(
        "--slow", action="store_true", help="accept rates below 50 Hz, for means only"
    )
    parser.add_argument(
        "--format",
        choices=("csv", "parquet"),
        default="csv",
        help="format of the tables (csv); parquet needs the extra traction[parquet]",
    )


def _add_wrench(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("wrench")
    group.add_argument(
        "--wrench", metavar="TOPIC", help="topic of the wrench, if there are several"
    )
    group.add_argument(
        "--sensor",
        metavar="LINK",
        help="link of the URDF in whose frame the wrench is expressed",
    )
    group.add_argument(
        "--acts",
        choices=("ground-on-foot", "foot-on-ground"),
        help="force that the wrench states: of the ground on the foot, or the reaction",
    )
    group.add_argument(
        "--tare",
        metavar="T0:T1|..",
        help="seconds of the log in which the foot is free, the reading without "
        "load (six numbers), or none if the sensor is tared",
    )
    group.add_argument(
        "--tool-mass",
        type=number_within(0, 20, "a mass of 0 to 20 kg, e.g. 0.21"),
        metavar="KG",
        help="mass of everything below the strain gauges",
    )
    group.add_argument(
        "--lag",
        metavar="MS",
        help="delay of the wrench's time stamps relative to the joints; 0 is allowed",
    )
    group.add_argument(
        "--estimated",
        action="store_true",
        help="the robot estimates the wrench from motor torques; marked on every page",
    )


def _add_ground(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("foot and ground, in axes of the base")
    group.add_argument("--foot", metavar="LINK", help="link of the URDF: the sole")
    group.add_argument("--along", metavar="X,Y,Z", help="direction of the slip")
    group.add_argument("--normal", metavar="X,Y,Z", help="normal of the ground")
    group.add_argument(
        "--terrain",
        default="table",
        metavar="NAME",
        help="name of the ground (default table)",
    )
    group.add_argument(
        "--factor",
        action="append",
        default=[],
        metavar="K=V",
        help="property of the ground, e.g. d50=19; can be repeated",
    )


def run(args: argparse.Namespace) -> int:
    """Import a log, or print its content; returns the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import WARNING, Console

    console = Console(color=not args.no_color)
    if args.list:
        from analysis.logs.suggestions import ListRequest, listing

        names = ("urdf", "foot", "sensor", "acts", "joints", "wrench", "clock")
        asked = {name: getattr(args, name) for name in names}
        for line in listing(ListRequest(args.log, **asked)):
            console.say(line)
        return 0
    given = vars(args)
    missing = [name for name in _NEEDED if given[name.replace("-", "_")] is None]
    if missing:
        raise SettingsError(
            f"An import needs {', '.join(f'--{name}' for name in missing)}.",
            hint="--list shows what the log holds, and with --urdf, --foot, --sensor "
            "and --acts the whole command line.",
        )
    if args.format == "parquet":
        from acquisition.extras import require_extra

        require_extra("parquet")
    from analysis.logs.importing import import_log
    from experiments.export.imported_tables import write_imported

    imported = import_log(request_of(args))
    for channel in (imported.joints, imported.wrench):
        console.say(f"{channel.topic.name}: {channel.clock.text}")
    for check in imported.checks:
        mark = f"{WARNING} " if check.warning else ""
        console.say(f"{mark}{check.text}")
    write_imported(imported, _plain(args), args.to, args.format, console)
    console.say(f"{args.to}: traction fit {args.to} --to REPORT")
    return 0


def _plain(args: argparse.Namespace) -> dict[str, str]:
    """Return the given options as text."""
    left_out = {"run", "command", "verbose", "no_color", "config", "data", "list"}
    return {
        name.replace("_", "-"): str(value)
        for name, value in vars(args).items()
        if name not in left_out and value not in (None, False, [])
    }


def request_of(args: argparse.Namespace) -> ImportRequest:
    """Build the request from the options; raises SettingsError."""
    from analysis.logs.request import ImportRequest

    return ImportRequest(
        log=args.log,
        urdf=args.urdf,
        foot=args.foot,
        sensor=args.sensor,
        acts=args.acts,
        tare=_tare(args.tare),
        mass=args.tool_mass,
        along=_vector("--along", args.along),
        normal=_vector("--normal", args.normal),
        lag=_numbers("--lag", args.lag, 1, ",")[0] * 1e-3,
        trials=_trials(args.trials),
        joints=args.joints,
        wrench=args.wrench,
        clock=args.clock,
        terrain=args.terrain,
        factors=_factors(args.factor),
        is_slow=args.slow,
        is_estimated=args.estimated,
    )


def _tare(text: str) -> Tare:
    if text == "none":
        return "none"
    if text.count(",") == 5:
        import numpy as np

        return np.array(_numbers("--tare", text, 6, ","))
    return _span("--tare", text)


def _span(option: str, text: str) -> tuple[float, float]:
    from acquisition.errors import SettingsError

    first, end = _numbers(option, text, 2, ":")
    if not first < end:
        raise SettingsError(
            f"{option} {text[:60]} is empty.", hint="Give the earlier time first."
        )
    return first, end


def _trials(text: str) -> list[tuple[float, float]]:
    """Parse disjoint spans of time: each row belongs to one trial."""
    from itertools import pairwise

    from acquisition.errors import SettingsError

    spans = [_span("--trials", span) for span in text.split(",")]
    for (_, end), (start, last) in pairwise(sorted(spans)):
        if start < end:
            raise SettingsError(
                f"--trials {text[:60]}: two of them share {start:g} to "
                f"{min(end, last):g} s.",
                hint="Give spans that do not overlap. Nothing was read.",
            )
    return spans


def _vector(option: str, text: str) -> NDArray[np.float64]:
    import numpy as np

    from acquisition.errors import SettingsError

    vector = np.array(_numbers(option, text, 3, ","))
    if not 1e-6 < float(np.linalg.norm(vector)) < 1e6:
        raise SettingsError(
            f"{option} {text[:60]} has no direction.", hint="E.g. 1,0,0."
        )
    return vector


def _numbers(option: str, text: str, count: int, mark: str) -> list[float]:
    from acquisition.errors import SettingsError

    try:
        numbers = [float(part) for part in text.split(mark)]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        wanted = "a number" if count == 1 else f"{count} numbers with {mark!r} between"
        raise SettingsError(
            f"{option} {text[:60]!r}: expected {wanted}.", hint="Nothing was read."
        )
    return numbers


def _factors(given: list[str]) -> Mapping[str, Value]:
    from acquisition.errors import SettingsError
    from analysis.data.recorded_factors import checked_factors

    values: dict[str, Value] = {}
    for text in given:
        name, mark, value = text.partition("=")
        if name in values:
            raise SettingsError(
                f"--factor {name[:60]} is given twice.",
                hint="Leave one. Nothing was read.",
            )
        try:
            values[name] = float(value)
        except ValueError:
            values[name] = value
        if not mark or not checked_factors({name: values[name]}):
            raise SettingsError(
                f"--factor {text[:60]!r} - expected NAME=VALUE, e.g. d50=19.",
                hint="Nothing was read.",
            )
    return checked_factors(values)
