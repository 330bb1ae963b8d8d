"""traction replay: what was said on the bus, in words."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.console import Console
    from wam.bus_words import Spoken, Tally

EXAMPLES = """\
  traction replay --can bus.log             every frame, then the sums
  traction replay --can bus.log --summary   the sums only"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `replay`."""
    parser.add_argument(
        "--can",
        type=Path,
        required=True,
        metavar="FILE",
        help="a bus log of --can-log, or of candump -L",
    )
    parser.add_argument("--summary", action="store_true", help="only the sums")


def run(args: argparse.Namespace) -> int:
    """Print the log in words and return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.console import Console
    from wam.bus_words import BusReader
    from wam.can_log import LONGEST_LINE, parse_log

    console = Console(color=not args.no_color)
    reader = BusReader()
    start_ns: int | None = None

    def tell(spoken: list[Spoken]) -> None:
        if args.summary:
            return
        for said in spoken:
            console.say(f"{(said.utc_ns - (start_ns or 0)) / 1e9:12.6f}  {said.text}")

    try:
        with args.can.open(encoding="ascii", errors="replace") as file:
            # A line is cut: a file without line ends must not fill the memory.
            lines = iter(lambda: file.readline(LONGEST_LINE), "")
            for frame in parse_log(lines):
                start_ns = frame.utc_ns if start_ns is None else start_ns
                tell(reader.read(frame))
                if console.is_lost:
                    return 0
    except OSError as error:
        raise SettingsError(
            f"{args.can} cannot be read: {error.strerror or error}.",
            hint="Name a file that --can-log wrote.",
        ) from error
    tell(reader.finish())
    _sum_up(reader.tally, console)
    return 0


def _sum_up(tally: Tally, console: Console) -> None:
    silent = sum(tally.silent.values())
    console.say(
        f"{tally.frames} frames, {tally.foreign} of other kinds. {tally.questions} "
        f"answers asked for: {tally.answers} came, {tally.late} of them after more "
        f"than 1 ms, {silent} never came; {tally.unasked} came unasked."
    )
    if tally.answers:
        console.say(f"Slowest answer: {tally.slowest_ns // 1000} us.")
    for what, count in tally.silent.most_common():
        console.say(f"  unanswered {count:6d}  {what}")
