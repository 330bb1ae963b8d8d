"""traction bench: measure the control loop on this machine."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.operator.console import Console
    from experiments.preflight.loop_benchmark import BenchReport

EXAMPLES = """\
  traction bench --fake --seconds 60        the loop with simulated devices
  traction bench --json                     the real rig, arm idle, no torque sent"""

_LONGEST = 7200.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `bench`."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--seconds", type=float, default=60.0, metavar="N", help="duration (default 60)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Measure and print; returns the exit code."""
    import json
    import os
    from contextlib import closing

    from acquisition.errors import PreflightError, SettingsError
    from experiments.operator.console import WARNING, Console
    from experiments.settings.load import load_settings

    if not 1.0 <= args.seconds <= _LONGEST:
        raise SettingsError(
            f"--seconds {args.seconds:g} - expected a number from 1 to {_LONGEST:g}.",
            hint="Nothing was started.",
        )
    console = Console(color=not args.no_color, goes_on=True)
    settings = load_settings(args.config)
    if not args.json:
        console.say(f"Measuring the loop for {args.seconds:g} s ...")
    # slow to import
    from experiments.preflight.connecting import connect_rig
    from experiments.preflight.loop_benchmark import run_bench
    from experiments.preflight.preflight import start_devices
    from experiments.rig.processes import MultiProcessBackend
    from experiments.rig.rig import FakeOptions

    fake = FakeOptions("processes", seed=1) if args.fake else None
    rig = connect_rig(settings, settings.matrix.terrains[0], fake)
    backend = rig.backend
    assert isinstance(backend, MultiProcessBackend)
    with closing(backend):
        for text in start_devices(rig).warnings:
            console.problem(text)
        processes = {**backend.processes(), "console": os.getpid()}
        report = run_bench(rig, processes, args.seconds)
    if report.fault:
        console.problem(f"{WARNING} {report.fault}")
    if args.json:
        console.say(json.dumps(report.as_dict(), indent=2))
    else:
        _print(report, args.seconds, console)
    must_power = args.fake or report.fault  # a real arm without a fault stays idle
    return PreflightError.exit_code if must_power and not report.is_powered else 0


def _print(report: BenchReport, seconds: float, console: Console) -> None:
    loop = report.loop
    law = "control law on" if report.is_powered else "arm idle, no torque sent"
    console.say(
        f"{loop.cycles} cycles in {seconds:g} s, {loop.rate:.2f} Hz, {law}; "
        f"missed {loop.missed}"
    )
    console.say("us                                p50      p99    p99.9      max")
    for name, spread in (
        ("wake-up after the deadline", loop.late),
        ("request to 7th position", loop.exchange),
        ("last reply to torque out", loop.compute),
        ("deadline to torque out", loop.torque_out),
        ("deadline to end of cycle", loop.total),
    ):
        if spread is not None:
            console.say(
                f"{name:28}{spread.p50:9.1f}{spread.p99:9.1f}{spread.p999:9.1f}"
                f"{spread.worst:9.1f}"
            )
    console.say("process              CPU of a core   memory growth   page faults")
    for use in report.processes:
        console.say(
            f"{use.name:20}{use.cpu:13.1%}{use.growth_kb:11.0f} KiB{use.page_faults:14}"
        )
    console.say(
        f"recorder: {report.recorded} cycles written, {report.lost} lost, largest "
        f"backlog {report.largest_backlog}"
    )
