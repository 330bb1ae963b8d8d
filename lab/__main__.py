"""Boot the emulated machine and run scenarios: python -m lab [--only NAME] ..."""

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
NOT_READY = 75  # EX_TEMPFAIL: a package has to be installed first
_DEFAULT_MACHINES = 2
_CLOCK = SystemClock()
_JOB = """\
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
cd {root}
{python} -m lab.guest {names}
echo b > /proc/sysrq-trigger
sleep 60
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    options = argparse.ArgumentParser(prog="python -m lab", description=__doc__)
    options.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="run this scenario"
    )
    options.add_argument("--list", action="store_true", help="list the scenarios")
    options.add_argument(
        "--check", action="store_true", help="only check for missing packages"
    )
    options.add_argument("--cache", type=Path, default=CACHE, metavar="FOLDER")
    options.add_argument(
        "--machines",
        type=int,
        choices=range(1, 9),
        default=min(_DEFAULT_MACHINES, os.cpu_count() or 1),
        help="number of machines at once; each keeps a core busy",
    )
    options.add_argument(
        "--console", action="store_true", help="show the machine's console"
    )
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    options = parser().parse_args(arguments)
    names = {scenario.name for scenario in ALL}
    if unknown := [name for name in options.only if name not in names]:
        print(f"No scenario {unknown[0]!r}; there are: {', '.join(sorted(names))}")
        return 2
    scenarios = chosen(options.only)
    if options.list:
        print("\n".join(f"{s.name:<28} {s.what}" for s in scenarios))
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
    print(report.missed_cycles_line(results))
    print(report.summary(results, wall))
    return 0 if all(result.verdict.is_fine for result in results) else 1


def shares(scenarios: Sequence[Scenario], count: int) -> list[list[Scenario]]:
    """Distribute scenarios over at most `count` machines; none is left empty.

    Scenarios are assigned by decreasing weight, each to the least loaded machine.
    """
    parts: list[list[Scenario]] = [[] for _ in range(min(count, len(scenarios)))]
    for scenario in sorted(scenarios, key=lambda each: -each.weight):
        least_loaded = min(parts, key=lambda part: sum(each.weight for each in part))
        least_loaded.append(scenario)
    return parts


def run_machines(
    parts: Sequence[Sequence[Scenario]], cache: Path, *, is_shown: bool
) -> list[ScenarioResult]:
    """Run one machine per part in parallel; return the results in the order of ALL."""
    fetch_kernel(cache)  # before the machines use it in parallel
    for package in _PROGRAM:  # compiling is many times slower in the emulator
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
    """Run scenarios in turn and return their results; reboot after a kernel panic.

    A user program cannot make the kernel panic, but the emulator sometimes does. The
    interrupted scenario is repeated once, which its result mentions.

    Args:
        scenarios: scenarios to run.
        cache: folder of the unpacked kernel.
        is_shown: also print the machine's own output.
    """
    results: list[ScenarioResult] = []
    repeated: set[str] = set()
    remaining = list(scenarios)
    while remaining:
        batch = boot(remaining, cache, is_shown=is_shown)
        last = batch[-1]
        if last.reason != PANICKED or last.name in repeated:
            results += batch
            break
        repeated.add(last.name)
        results += batch[:-1]
        done = {result.name for result in results}
        remaining = [scenario for scenario in remaining if scenario.name not in done]
    return [
        replace(result, figures={**result.figures, "repeated": PANICKED})
        if result.name in repeated
        else result
        for result in results
    ]


def boot(
    scenarios: Sequence[Scenario], cache: Path, *, is_shown: bool
) -> list[ScenarioResult]:
    """Boot once, run scenarios in turn and return their results, at least one.

    Args:
        scenarios: scenarios to run.
        cache: folder of the unpacked kernel.
        is_shown: also print the machine's own output.
    """
    kernel = fetch_kernel(cache)
    names = " ".join(shlex.quote(scenario.name) for scenario in scenarios)
    if is_shown:
        names += " --echo"
    job = _JOB.format(root=ROOT, python=sys.executable, names=names)
    with tempfile.TemporaryDirectory(prefix="lab") as scratch:
        folder = Path(scratch)
        root_archive = folder / "initramfs"
        busybox = Path(program("busybox"))
        root_archive.write_bytes(initramfs.build(busybox, kernel.modules, job))
        files = ("line", "monitor", "memory", "debugger")
        sockets = Sockets(*(folder / name for name in files))
        machine = Machine(kernel, root_archive, sockets)
        try:
            run = Follower(is_shown=is_shown)
            return run.follow(machine, [scenario.name for scenario in scenarios])
        finally:
            machine.close()


if __name__ == "__main__":
    sys.exit(main())
