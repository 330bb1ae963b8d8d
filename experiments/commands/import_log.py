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
    from analysis.logs.estimates import Estimate
    from analysis.logs.importing import ImportRequest, Tare

EXAMPLES = """\
  traction import log.mcap --urdf robot.urdf --list     topics, rates, links
  traction import log.mcap --urdf robot.urdf --foot foot --sensor ft_frame
      --acts ground-on-foot --tool-mass 0.21 --to gravel    then: traction fit gravel"""
_NEEDED = ("to", "urdf", "foot", "sensor", "acts")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `import`."""
    parser.add_argument(
        "log",
        type=Path,
        metavar="LOG",
        help=".mcap, .db3 or folder of rosbag2, or ROS 1 .bag",
    )
    parser.add_argument(
        "--list",
        action="store_true",
        help="only say what the log and the URDF hold: the first thing to try",
    )
    parser.add_argument("--to", type=Path, metavar="DIR", help="tables, a new folder")
    parser.add_argument("--urdf", type=Path, metavar="FILE", help="of the robot")
    _add_wrench(parser)
    _add_ground(parser)
    parser.add_argument("--joints", metavar="TOPIC", help="of several JointStates")
    parser.add_argument(
        "--lag",
        default="auto",
        metavar="MS|auto",
        help="how late the wrench is stamped (auto)",
    )
    parser.add_argument(
        "--clock",
        choices=("stamp", "receipt"),
        help="times of the messages (stamps, where they can be used)",
    )
    parser.add_argument(
        "--trials",
        default="auto",
        metavar="T0:T1,..|auto",
        help="seconds of the log, a trial each (every stroke)",
    )
    parser.add_argument(
        "--slow", action="store_true", help="take rates below 50 Hz, for means only"
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
        "--wrench", metavar="TOPIC[:FIELD]", help="of several; a field with points"
    )
    group.add_argument("--sensor", metavar="FRAME", help="link whose axes it has")
    group.add_argument(
        "--acts",
        choices=("ground-on-foot", "foot-on-ground"),
        help="what its numbers are; no message says it",
    )
    group.add_argument(
        "--tare",
        metavar="T0:T1|FILE|..",
        help="unloaded seconds of the log, a log of the free foot, six numbers with "
        "commas, or none for a sensor that is tared (found)",
    )
    group.add_argument(
        "--tool-mass",
        type=number_within(0, 20, "a mass of 0 to 20 kg, e.g. 0.21"),
        metavar="KG",
        help="of all below the gauges (found, where the free sensor turns)",
    )
    group.add_argument(
        "--estimated",
        action="store_true",
        help="the robot estimates it, no sensor measures it; marked everywhere",
    )


def _add_ground(parser: argparse.ArgumentParser) -> None:
    degrees = number_within(-360, 360, "degrees, e.g. 10")
    group = parser.add_argument_group("foot and ground, in axes of the base")
    group.add_argument("--foot", metavar="FRAME", help="link of the URDF: the sole")
    group.add_argument(
        "--along", metavar="X,Y,Z", help="direction of the slip (chord of the way)"
    )
    group.add_argument(
        "--normal", metavar="X,Y,Z", help="of the ground (plane of the way)"
    )
    group.add_argument(
        "--heading", type=degrees, metavar="DEG", help="of the slip about z, from x"
    )
    group.add_argument(
        "--incline", type=degrees, metavar="DEG", help="along the slip, > 0 uphill"
    )
    group.add_argument("--terrain", default="table", metavar="NAME", help="its name")
    group.add_argument(
        "--factor",
        action="append",
        default=[],
        metavar="K=V",
        help="what else is known of it, e.g. d50=19; more than once for several",
    )


def run(args: argparse.Namespace) -> int:
    """Import a log, or say what it holds, and return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console

    console = Console(color=not args.no_color)
    if args.list:
        from analysis.logs.log_listing import listing

        for line in listing(args.log, args.urdf):
            console.say(line)
        return 0
    missing = [f"--{name}" for name in _NEEDED if getattr(args, name) is None]
    if missing:
        raise SettingsError(
            f"An import needs {', '.join(missing)}.",
            hint="--list shows the topics of the log and the links of the URDF.",
        )
    if args.format == "parquet":
        from acquisition.extras import require_extra

        require_extra("parquet")
    from analysis.logs.importing import import_log
    from experiments.export.imported_tables import write_imported

    imported = import_log(request_of(args))
    for estimate in imported.estimates:
        console.say(_said(estimate))
    write_imported(imported, _plain(args), args.to, args.format, console)
    console.say(f"{args.to}: traction fit {args.to} --to REPORT")
    return 0


def _said(estimate: Estimate) -> str:
    """Return an estimate with its spread in one line."""
    value, spread = (
        ", ".join("not known" if math.isnan(x) else f"{x:.4g}" for x in numbers)
        for numbers in (estimate.value, estimate.spread)
    )
    about = f"{estimate.how}: {spread}" if spread else estimate.how
    return f"{estimate.name}: {value} {estimate.unit}".rstrip() + f" ({about})"


def _plain(args: argparse.Namespace) -> dict[str, str]:
    """Return the options that were given, as text."""
    left_out = {"run", "command", "verbose", "no_color", "config", "data", "list"}
    return {
        name.replace("_", "-"): str(value)
        for name, value in vars(args).items()
        if name not in left_out and value not in (None, False, [])
    }


def request_of(args: argparse.Namespace) -> ImportRequest:
    """Return what is asked for; raises SettingsError."""
    from analysis.logs.importing import ImportRequest

    _refuse_both(args, "along", "heading")
    _refuse_both(args, "normal", "incline")
    lag = None if args.lag == "auto" else _numbers("--lag", args.lag, 1, ",")[0] * 1e-3
    spans = None if args.trials == "auto" else _trials(args.trials)
    return ImportRequest(
        log=args.log,
        urdf=args.urdf,
        foot=args.foot,
        sensor=args.sensor,
        acts=args.acts,
        wrench=args.wrench,
        joints=args.joints,
        tare=_tare(args.tare),
        mass=args.tool_mass,
        along=_vector("--along", args.along),
        normal=_vector("--normal", args.normal),
        incline_deg=args.incline,
        heading_deg=args.heading,
        lag=lag,
        clock=args.clock,
        trials=spans,
        terrain=args.terrain,
        factors=_factors(args.factor),
        is_slow=args.slow,
        is_estimated=args.estimated,
    )


def _refuse_both(args: argparse.Namespace, vector: str, angle: str) -> None:
    """Refuse two options that say the same thing."""
    from acquisition.errors import SettingsError

    if None not in (getattr(args, vector), getattr(args, angle)):
        raise SettingsError(
            f"--{vector} and --{angle} give the same direction.",
            hint="Give one of them. Nothing was read.",
        )


def _tare(text: str | None) -> Tare:
    if text is None:
        return None
    if text == "none":
        return "none"
    path = Path(text)
    if path.exists():
        return path
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
    """Return spans that share no time: each row belongs to one trial."""
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


def _vector(option: str, text: str | None) -> NDArray[np.float64] | None:
    from acquisition.errors import SettingsError

    if text is None:
        return None
    import numpy as np

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
