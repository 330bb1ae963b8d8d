"""Boots the machine and runs scenarios: python -m lab [--only NAME] ..."""

import argparse
import compileall
import os
import shlex
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock
from lab import initramfs, report
from lab.follower import PANICKED, Follower
from lab.guest.scenarios.registry import ALL, Scenario, chosen
from lab.kernel import fetch_kernel
from lab.machine import Machine, Sockets
from lab.requirements import LabError, install_line, missing_packages, program
from lab.results import ScenarioResult

ROOT = Path(__file__).parents[1]
_PROGRAM = (
    "acquisition",
    "analysis",
    "experiments",
    "fakes",
    "ft_sensor",
    "wam",
    "lab",
)
CACHE = ROOT / ".lab"
NOT_READY = 75  # as EX_TEMPFAIL: something has to be installed first
_MOST_MACHINES = 2  # unless more are asked for
_CLOCK = SystemClock()
_JOB = """\
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
cd {root}
{python} -m lab.guest {names}
echo b > /proc/sysrq-trigger
sleep 60
"""


def parser() -> argparse.ArgumentParser:
    """Return the options."""
    options = argparse.ArgumentParser(prog="python -m lab", description=__doc__)
    options.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="this scenario"
    )
    options.add_argument("--list", action="store_true", help="name them and end")
    options.add_argument(
        "--check", action="store_true", help="say what is missing and end"
    )
    options.add_argument("--cache", type=Path, default=CACHE, metavar="FOLDER")
    options.add_argument(
        "--machines",
        type=int,
        choices=range(1, 9),
        default=min(_MOST_MACHINES, os.cpu_count() or 1),
        help="so many at once; each keeps a core busy",
    )
    options.add_argument(
        "--console", action="store_true", help="show what the machine says"
    )
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the arguments ask for; return the exit code."""
    options = parser().parse_args(arguments)
    names = {scenario.name for scenario in ALL}
    if unknown := [name for name in options.only if name not in names]:
        print(f"--only {unknown[0]!r} is none of: {', '.join(sorted(names))}")
        return 2
    scenarios = chosen(options.only)
    if options.list:
        print("\n".join(f"{one.name:<28} {one.what}" for one in scenarios))
        return 0
    return _run_if_ready(scenarios, options)


def _run_if_ready(scenarios: Sequence[Scenario], options: argparse.Namespace) -> int:
    if missing := missing_packages():
        print(f"The laboratory needs: {', '.join(missing)}. As root:")
        print(f"    {install_line(missing)}")
        return NOT_READY
    if options.check:
        return 0
    try:
        return _run(scenarios, options)
    except LabError as error:
        print(error)
        return NOT_READY


def _run(scenarios: Sequence[Scenario], options: argparse.Namespace) -> int:
    start_ns = _CLOCK.now_ns()
    parts = shares(scenarios, options.machines)
    results = run_machines(parts, options.cache, is_shown=options.console)
    wall = (_CLOCK.now_ns() - start_ns) / NS_PER_S
    print(report.cycle_words(results))
    print(report.summary(results, wall))
    return 0 if all(result.verdict.is_fine for result in results) else 1


def shares(scenarios: Sequence[Scenario], count: int) -> list[list[Scenario]]:
    """Return what each of at most `count` machines runs; none is empty.

    The heaviest goes first, each to the machine that has the least until then.
    """
    parts: list[list[Scenario]] = [[] for _ in range(min(count, len(scenarios)))]
    for one in sorted(scenarios, key=lambda scenario: -scenario.weight):
        min(parts, key=lambda part: sum(other.weight for other in part)).append(one)
    return parts


def run_machines(
    parts: Sequence[Sequence[Scenario]], cache: Path, *, is_shown: bool
) -> list[ScenarioResult]:
    """Run a machine for each part, all at once; return results in ALL's order."""
    fetch_kernel(cache)  # once, before they all want it
    for package in _PROGRAM:  # the emulated processor is many times slower at it
        compileall.compile_dir(ROOT / package, quiet=1)
    with ThreadPoolExecutor(max(1, len(parts))) as pool:
        runs = [
            pool.submit(run_machine, part, cache, is_shown=is_shown) for part in parts
        ]
        results = [result for run in runs for result in run.result()]
    order = {scenario.name: number for number, scenario in enumerate(ALL)}
    return sorted(results, key=lambda result: order.get(result.name, -1))


def run_machine(
    scenarios: Sequence[Scenario], cache: Path, *, is_shown: bool
) -> list[ScenarioResult]:
    """Run scenarios in turn and return their results; boot again after a panic.

    No program of a user can make a kernel panic; the emulator does so now and then.
    The scenario that it panics in is repeated once, and its result says so.

    Args:
        scenarios: what to run.
        cache: where the kernel is kept.
        is_shown: the machine's own output is printed, too.
    """
    results: list[ScenarioResult] = []
    repeated: set[str] = set()
    left = list(scenarios)
    while left:
        came = boot(left, cache, is_shown=is_shown)
        lost = came[-1]
        if lost.reason != PANICKED or lost.name in repeated:
            results += came
            break
        repeated.add(lost.name)
        results += came[:-1]
        done = {result.name for result in results}
        left = [scenario for scenario in left if scenario.name not in done]
    return [
        replace(result, figures={**result.figures, "repeated": PANICKED})
        if result.name in repeated
        else result
        for result in results
    ]


def boot(
    scenarios: Sequence[Scenario], cache: Path, *, is_shown: bool
) -> list[ScenarioResult]:
    """Boot, run scenarios in turn and return their results, at least one.

    Args:
        scenarios: what to run.
        cache: where the kernel is kept.
        is_shown: the machine's own output is printed, too.
    """
    kernel = fetch_kernel(cache)
    words = " ".join(shlex.quote(scenario.name) for scenario in scenarios)
    if is_shown:
        words += " --echo"
    job = _JOB.format(root=ROOT, python=sys.executable, names=words)
    with tempfile.TemporaryDirectory(prefix="lab") as scratch:
        folder = Path(scratch)
        first_root = folder / "initramfs"
        busybox = Path(program("busybox"))
        first_root.write_bytes(initramfs.build(busybox, kernel.modules, job))
        names = ("line", "monitor", "memory", "debugger")
        sockets = Sockets(*(folder / name for name in names))
        machine = Machine(kernel, first_root, sockets)
        try:
            run = Follower(is_shown=is_shown)
            return run.follow(machine, [one.name for one in scenarios])
        finally:
            machine.close()


if __name__ == "__main__":
    sys.exit(main())
