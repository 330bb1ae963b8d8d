"""traction watch: show a session of another process on a second screen."""

import argparse

from experiments.arguments import add_port_option

EXAMPLES = """\
  traction watch                the session that is recorded, at ws://127.0.0.1:8765
  traction watch S012 --port 0  this session, at any free port"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `watch`."""
    parser.add_argument(
        "session", nargs="?", metavar="SESSION", help="S012 (the one being recorded)"
    )
    add_port_option(parser)


def run(args: argparse.Namespace) -> int:
    """Serve recorded sessions until Ctrl-C; returns the exit code."""
    from acquisition.clock import SystemClock
    from experiments.commands.live.watching import watch
    from experiments.operator.console import Console
    from experiments.run.stop import StopFlag, handle_signals

    console, stop = Console(color=not args.no_color, goes_on=True), StopFlag()
    with handle_signals(stop):
        watch(
            args.data,
            args.session,
            int(args.port),
            console,
            SystemClock(),
            is_over=lambda: stop.count > 0 or console.is_lost,
        )
    return 0
