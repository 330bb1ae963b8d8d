"""traction replay: play back a trial, or decode a bus log."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import (
    add_allow_missing_option,
    add_port_option,
    number_within,
)

if TYPE_CHECKING:
    from experiments.operator.console import Console
    from wam.bus.log import BusSummary, CanLogError, DecodedLine

EXAMPLES = """\
  traction replay S012 T04 --speed 2        a trial, twice as fast as it was
  traction replay --can bus.log --summary   a bus log, totals only"""

_LEFT_OUT = 6  # exit code
_MOST_REPORTED = 5  # malformed lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `replay`."""
    parser.add_argument(
        "session", nargs="?", metavar="SESSION", help="S012 or a folder"
    )
    parser.add_argument(
        "trial", nargs="?", metavar="TRIAL", help="T04, or T04a of rejected/"
    )
    parser.add_argument(
        "--speed",
        type=number_within(0.01, 10_000, "a number > 0, e.g. 2"),
        default=1.0,
        metavar="N",
        help="replay speed (default 1)",
    )
    parser.add_argument(
        "--can",
        type=Path,
        metavar="FILE",
        help="a bus log of --can-log, or of candump -L",
    )
    add_allow_missing_option(parser)
    parser.add_argument(
        "--serve",
        action="store_true",
        help="serve the trial to viewers on this computer; needs traction[live]",
    )
    add_port_option(parser, "--serve: ")
    parser.add_argument("--summary", action="store_true", help="totals only")


def run(args: argparse.Namespace) -> int:
    """Show a trial or a bus log; returns the exit code."""
    from acquisition.errors import SettingsError

    is_trial = args.session is not None and args.trial is not None
    if args.serve and not is_trial:
        raise SettingsError(
            "--serve needs a session and a trial.",
            hint="For example: traction replay S012 T04 --serve",
        )
    if is_trial == (args.can is not None) or (args.session and not args.trial):
        raise SettingsError(
            "Either a session and a trial are shown, or a bus log.",
            hint="For example: traction replay S012 T04, or traction replay --can FILE",
        )
    return _show_trial(args) if is_trial else _show_log(args)


def _show_trial(args: argparse.Namespace) -> int:
    from acquisition.clock import SystemClock
    from experiments.commands.live.playback import play
    from experiments.operator.console import Console
    from experiments.session.annotations import trial_path
    from experiments.session.kept_files import compare_trial, kept_data_error
    from experiments.session.store import find_session

    console = Console(color=not args.no_color)
    folder = find_session(args.data, args.session)
    path = trial_path(folder, args.trial)
    deviations = compare_trial(folder, path)
    if deviations and not args.allow_missing:
        raise kept_data_error(deviations)
    if args.serve:
        return _serve_trial(args, path, console)
    play(path, args.speed, SystemClock(), console)
    return 0


def _serve_trial(args: argparse.Namespace, path: Path, console: Console) -> int:
    from acquisition.clock import SystemClock
    from experiments.commands.live.playback import serve
    from experiments.run.stop import StopFlag, handle_signals

    stop = StopFlag()
    with handle_signals(stop):
        serve(
            path,
            args.speed,
            int(args.port),
            SystemClock(),
            console,
            is_over=lambda: stop.count > 0 or console.is_lost,
        )
    return 0


def _show_log(args: argparse.Namespace) -> int:
    from acquisition.errors import SettingsError
    from experiments.operator.console import Console
    from wam.bus.decoder import BusReader
    from wam.bus.log import parse_log, read_lines

    console = Console(color=not args.no_color)
    reader = BusReader()
    start_ns: int | None = None
    malformed = 0

    def report_malformed(error: CanLogError) -> None:
        nonlocal malformed
        malformed += 1
        if malformed <= _MOST_REPORTED:
            console.problem(str(error))

    def print_lines(lines: list[DecodedLine]) -> None:
        if args.summary:
            return
        for line in lines:
            console.say(f"{(line.utc_ns - (start_ns or 0)) / 1e9:12.6f}  {line.text}")

    try:
        with args.can.open(encoding="utf-8-sig", errors="replace") as file:
            for frame in parse_log(read_lines(file), report_malformed):
                start_ns = frame.utc_ns if start_ns is None else start_ns
                print_lines(reader.read(frame))
                if console.is_lost:
                    return 0
    except OSError as error:
        raise SettingsError(
            f"{args.can} cannot be read: {error.strerror or error}.",
            hint="Name a file that --can-log wrote.",
        ) from error
    print_lines(reader.finish())
    _print_summary(reader.tally, console)
    if malformed:
        console.problem(f"{malformed} malformed lines were left out.")
    return _LEFT_OUT if malformed else 0


def _print_summary(tally: BusSummary, console: Console) -> None:
    silent = sum(tally.unanswered.values())
    console.say(
        f"{tally.frames} frames, {tally.foreign} of other kinds. {tally.questions} "
        f"answers requested: {tally.answers} came, {tally.late} of them after more "
        f"than 1 ms, {silent} did not come; {tally.unsolicited} came without a request."
    )
    if tally.gaps:
        longest = tally.longest_gap_ns / 1e9
        console.say(
            f"Gaps of more than 1 s: {tally.gaps}, the longest {longest:.1f} s."
        )
    if tally.jumps:
        console.problem(
            f"Time goes back {tally.jumps} times: the clock was set, or it is several "
            "logs in one. No answer is counted across it."
        )
    if tally.errors:
        counts = ", ".join(f"{name} {n}" for name, n in sorted(tally.errors.items()))
        console.say(f"Error frames of the controller: {counts}.")
    if tally.answers:
        console.say(f"Slowest answer: {tally.slowest_ns // 1000} us.")
    for what, count in tally.unanswered.most_common():
        console.say(f"  unanswered {count:6d}  {what}")
