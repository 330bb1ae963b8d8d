"""traction fake: serve the simulated arm and wrist sensor to other programs."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.operator import Console
    from experiments.settings import Settings
    from experiments.tools import Press, Pressable

EXAMPLES = """\
  traction fake --can traction-fake:/tmp/wam.sock --idle-first
  traction fake --serial /tmp/sensor --sensor optoforce"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `fake`."""
    parser.add_argument(
        "--can",
        metavar="INTERFACE:CHANNEL",
        help="where the arm is: traction-fake:PATH, or any bus of python-can",
    )
    parser.add_argument(
        "--serial",
        type=Path,
        metavar="PATH",
        help="serve a serial wrist sensor at this new path; alone, or on the arm",
    )
    parser.add_argument(
        "--sensor",
        choices=("bota", "robotous", "optoforce"),
        default="bota",
        help="which one (default: bota)",
    )
    parser.add_argument(
        "--idle-first",
        action="store_true",
        help="begin powered and idle, pucks asleep; otherwise in E-STOP",
    )
    parser.add_argument(
        "--script",
        type=Path,
        metavar="FILE",
        help="lines that press the pendant, as on stdin: "
        "[SECONDS] activate|idle|estop|quit",
    )
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every frame there"
    )


def run(args: argparse.Namespace) -> int:
    """Serve until a signal ends it and return the exit code."""
    from acquisition import SystemClock
    from experiments.operator import Console
    from experiments.rig import build_server, open_bus_log
    from experiments.run import StopFlag, handle_signals
    from experiments.settings import load_settings
    from experiments.tools import PRESSES, Lines, Pendant, read_script

    bus = _split(args.can) if args.can else None
    script = None if args.script is None else read_script(args.script)
    settings = load_settings(args.config)
    console = Console(color=not args.no_color)
    clock, stop = SystemClock(), StopFlag()
    line = (args.serial, args.sensor) if args.serial else None
    if bus is None:
        return _serve_sensor(settings, line, console)
    with (
        handle_signals(stop),
        open_bus_log(args.can_log, clock, "fake0", console) as log,
        closing(build_server(settings, bus, line, is_idle=args.idle_first)) as server,
    ):
        console.say(f"ready: {server.name}, safety module in {server.state}")
        pendant = Pendant(script, Lines(_stdin()), clock.now_ns())
        is_on = True
        while is_on and not stop.count:
            server.step(log.add if log else None)
            if log is not None:
                log.flush()
            is_on = _press(server, pendant.due(clock.now_ns()))
            for line in pendant.take_unknown():
                console.problem(f"{line[:60]!r} is none of {', '.join(PRESSES)}.")
        if server.losses:
            console.problem(server.losses)
    return 0


def _serve_sensor(
    settings: Settings, line: tuple[Path, str] | None, console: Console
) -> int:
    """Serve a sensor without an arm until a signal ends it."""
    from acquisition import SettingsError
    from experiments.rig import build_sensor_server
    from experiments.run import StopFlag, handle_signals

    if line is None:
        raise SettingsError(
            "There is nothing to serve.",
            hint="Name --can INTERFACE:CHANNEL, --serial PATH, or both.",
        )
    stop = StopFlag()
    with handle_signals(stop), closing(build_sensor_server(settings, line)) as server:
        console.say(f"ready: {server.name}")
        while not stop.count:
            server.wait()
            server.step()
        if server.losses:
            console.problem(server.losses)
    return 0


def _press(server: Pressable, presses: list[Press]) -> bool:
    """Press the buttons in turn; return False once one of them is quit."""
    for press in presses:
        if press == "quit":
            return False
        server.press(press)
    return True


def _split(text: str) -> tuple[str, str]:
    from acquisition import SettingsError

    interface, colon, channel = text.partition(":")
    if not (interface and colon and channel):
        raise SettingsError(
            f"--can {text!r} - expected INTERFACE:CHANNEL, "
            "e.g. traction-fake:/tmp/wam.sock.",
            hint="Nothing was started.",
        )
    return interface, channel


def _stdin() -> int | None:
    """Return the descriptor of stdin, None where there is none."""
    import sys

    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):
        return None
