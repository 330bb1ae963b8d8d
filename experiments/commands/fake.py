"""traction fake: serve the simulated arm and wrist sensor to other programs."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import number_within, whole_number
from experiments.rig.deviation_options import add_truth, truth_of

if TYPE_CHECKING:
    from experiments.operator.console import Console
    from experiments.operator.pendant import Order, Pressable
    from experiments.rig.fake import ServedArm
    from experiments.settings.load import Settings

EXAMPLES = """\
  traction fake --can traction-fake:/tmp/wam.sock --idle-first
  traction fake --can traction-fake:/tmp/wam.sock --idle-first --bare"""

_NEWEST, _LARGEST = 200, 0x7FFF  # VERS is a word of 16 bits, signed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `fake`."""
    parser.add_argument(
        "--can",
        metavar="INTERFACE:CHANNEL",
        help="bus to serve on: traction-fake:PATH, or any bus of python-can",
    )
    parser.add_argument(
        "--serial",
        type=Path,
        metavar="PATH",
        help="serve a serial wrist sensor at this new path, with the arm or alone",
    )
    parser.add_argument(
        "--sensor",
        default="bota",
        metavar="KIND",
        help="kind of the sensor: bota (default), robotous, optoforce, or another make",
    )
    parser.add_argument(
        "--idle-first",
        action="store_true",
        help="start idle, with the pucks asleep, instead of in E-STOP",
    )
    _add_arm(parser)
    _add_truth(parser)
    parser.add_argument(
        "--script",
        type=Path,
        metavar="FILE",
        help="lines that operate the pendant and the simulated hands, as on stdin: "
        "[SECONDS] activate|idle|estop|quit, pose q1..q7 SECONDS, "
        "stop JOINT low|high, hang KG, unhang, push FX FY FZ SECONDS, "
        "twist N_M SECONDS, release",
    )
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every CAN frame to FILE"
    )


def _add_arm(parser: argparse.ArgumentParser) -> None:
    """Declare the initial state of the arm, and who holds it."""
    parser.add_argument(
        "--bare",
        action="store_true",
        help="the arm alone: short for --hand none --tool none",
    )
    parser.add_argument(
        "--hand",
        choices=("carry", "none"),
        help="carry (default): a person holds the foot in place, with little joint "
        "friction; none: the arm is free, with the friction of a real arm",
    )
    parser.add_argument(
        "--tool",
        metavar="FOOT|none|FILE",
        help="what is mounted on the tool plate: the wrist sensor and a foot of "
        "rig.toml (default: that of the first terrain), neither, or the sensor and "
        "the foot of a TOML file with mass [kg], com [m], inertia [kg m2], sole [m]",
    )
    parser.add_argument(
        "--firmware",
        type=_firmware,
        default=(_NEWEST, _NEWEST),
        metavar="MOTORS[,SAFETY]",
        help=f"firmware version of the pucks and the safety module ({_NEWEST})",
    )


def _add_truth(parser: argparse.ArgumentParser) -> None:
    """Declare the pose of the arm and its true deviations."""
    parser.add_argument(
        "--pose",
        choices=("home", "rest"),
        default="home",
        help="initial pose: home (default), or rest: home with joint 6 on its upper "
        "stop, where nothing moves without torque",
    )
    parser.add_argument(
        "--seed",
        type=whole_number,
        metavar="N",
        help="random fault-free arm: zeros, stops, mounting and sensor are drawn with "
        "this seed (default: as in the drawings)",
    )
    parser.add_argument(
        "--friction",
        type=number_within(0.0, 2.0, "a number 0..2, e.g. 1"),
        metavar="SHARE",
        help="friction of the joints: 1 = as identified on another arm (0.02 with "
        "--hand carry, otherwise 1)",
    )
    add_truth(parser)


def run(args: argparse.Namespace) -> int:
    """Serve until a signal; returns the exit code."""
    from acquisition.clock import SystemClock
    from experiments.operator.console import Console
    from experiments.operator.pendant import Lines, Pendant, read_script
    from experiments.rig.bus_log import open_bus_log
    from experiments.rig.fake import build_server
    from experiments.run.stop import StopFlag, handle_signals
    from experiments.settings.load import load_settings

    served = _served(args)
    script = None if args.script is None else read_script(args.script)
    settings = load_settings(args.config)
    console = Console(color=not args.no_color, goes_on=True)
    clock, stop = SystemClock(), StopFlag()
    if served is None:
        return _serve_sensor(settings, args, console)
    with (
        handle_signals(stop, is_service=True),
        open_bus_log(args.can_log, clock, "fake0", console) as log,
        closing(build_server(settings, served)) as server,
    ):
        console.say(f"ready: {server.name}, safety module in {server.state}")
        pendant = Pendant(script, Lines(_stdin()), clock.now_ns())
        is_on = True
        while is_on and not stop.count:
            server.step(log.add if log else None)
            if log is not None:
                log.flush()
            is_on = _press(server, pendant.due(clock.now_ns()))
            for words in pendant.take_unknown():
                console.problem(f"{words}. Nothing was done.")
        if server.losses:
            console.problem(server.losses)
    return 0


def _served(args: argparse.Namespace) -> ServedArm | None:
    """Return the arm to serve; None = none."""
    from experiments.rig.fake import ServedArm

    if not args.can:
        return None
    return ServedArm(
        bus=_split(args.can),
        line=_line(args),
        is_idle_first=args.idle_first,
        tool=_tool(args),
        has_hand=(args.hand or ("none" if args.bare else "carry")) == "carry",
        firmware=args.firmware,
        is_at_rest=args.pose == "rest",
        friction=args.friction,
        seed=args.seed,
        truth=truth_of(args, args.seed),
    )


def _line(args: argparse.Namespace) -> tuple[Path, str] | None:
    """Return path and kind of a served serial sensor; None = none."""
    from acquisition.errors import SettingsError
    from ft_sensor.vendors.registry import SERIAL_KINDS

    if args.sensor not in SERIAL_KINDS:
        raise SettingsError(
            f"--sensor {args.sensor[:40]!r}: there is no such serial sensor.",
            hint=f"The kinds are {', '.join(SERIAL_KINDS)}. Nothing was started.",
        )
    return (args.serial, args.sensor) if args.serial else None


def _tool(args: argparse.Namespace) -> str:
    """Return the tool on the plate; --tool takes precedence over --bare."""
    return args.tool or ("none" if args.bare else "")


def _firmware(text: str) -> tuple[int, int]:
    """Parse the firmware of the pucks and of the safety module.

    Raises:
        ArgumentTypeError: neither one number nor two.
    """
    parts = text.split(",")
    is_number = all(part.isascii() and part.isdigit() for part in parts)
    numbers = [int(part) for part in parts] if is_number and len(text) < 12 else []
    if len(numbers) not in (1, 2) or max(numbers) > _LARGEST:
        raise argparse.ArgumentTypeError(f"{text!r} - expected e.g. 200 or 60,61")
    return numbers[0], numbers[-1]


def _serve_sensor(
    settings: Settings, args: argparse.Namespace, console: Console
) -> int:
    """Serve a sensor without an arm until a signal."""
    from acquisition.errors import SettingsError
    from experiments.rig.fake import build_sensor_server
    from experiments.run.stop import StopFlag, handle_signals

    line = _line(args)
    if line is None:
        raise SettingsError(
            "There is nothing to serve.",
            hint="Name --can INTERFACE:CHANNEL, --serial PATH, or both.",
        )
    stop = StopFlag()
    sensor = build_sensor_server(settings, line, _tool(args))
    with handle_signals(stop, is_service=True), closing(sensor) as server:
        console.say(f"ready: {server.name}")
        while not stop.count:
            server.wait()
            server.step()
        if server.losses:
            console.problem(server.losses)
    return 0


def _press(server: Pressable, orders: list[Order]) -> bool:
    """Execute orders to pendant and hands in turn; returns False after a quit."""
    for order in orders:
        if order == "quit":
            return False
        if isinstance(order, str):
            server.press(order)
        elif server.hands is not None:
            order.give(server.hands)
    return True


def _split(text: str) -> tuple[str, str]:
    from acquisition.errors import SettingsError

    interface, colon, channel = text.partition(":")
    if not (interface and colon and channel):
        raise SettingsError(
            f"--can {text!r} - expected INTERFACE:CHANNEL, "
            "e.g. traction-fake:/tmp/wam.sock.",
            hint="Nothing was started.",
        )
    return interface, channel


def _stdin() -> int | None:
    """Return the descriptor of stdin, or None."""
    import sys

    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return None
