"""Boots the machine and runs scenarios: python -m lab [--short] [--only NAME] ..."""

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
from typing import Protocol

from acquisition import NS_PER_S, SystemClock
from lab import initramfs, report, timer_rate
from lab.guest.scenarios.registry import ALL, Scenario, chosen
from lab.kernel import fetch_kernel
from lab.machine import (
    SLOWNESS,
    Machine,
    Sockets,
    command,
    emulator_version,
    processor_name,
)
from lab.requirements import LabError, install_line, missing_packages, program
from lab.results import (
    Begun,
    Finished,
    ScenarioResult,
    TimerAddresses,
    Verdict,
    from_line,
)

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
BOOT_LIMIT = 300.0  # s of wall time until the first scenario begins
LIMIT = 1500.0  # s of wall time for one scenario on a busy host
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
    options.add_argument("--short", action="store_true", help="the short form")
    options.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="this scenario"
    )
    options.add_argument("--list", action="store_true", help="name them and end")
    options.add_argument(
        "--check", action="store_true", help="say what is missing and end"
    )
    options.add_argument(
        "--write",
        type=Path,
        metavar="FILE",
        help="the table of a full run, e.g. docs/lab.md",
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
    if options.write and (options.short or options.only):
        print("--write belongs to a full run.")
        return 2
    scenarios = chosen(options.only, is_short=options.short)
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
    print(report.summary(results, wall))
    if options.write:
        what = {scenario.name: scenario.what for scenario in scenarios}
        conditions = report.Conditions(
            fetch_kernel(options.cache).release,
            emulator_version(),
            processor_name(),
            len(parts),
            wall,
        )
        page = report.page(results, what, conditions)
        options.write.write_text(page, encoding="utf-8")
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
    """Boot, run scenarios in turn and return their results.

    Args:
        scenarios: what to run.
        cache: where the kernel is kept.
        is_shown: the machine's own output is printed, too.
    """
    kernel = fetch_kernel(cache)
    names = " ".join(shlex.quote(scenario.name) for scenario in scenarios)
    if is_shown:
        names += " --echo"
    job = _JOB.format(root=ROOT, python=sys.executable, names=names)
    with tempfile.TemporaryDirectory(prefix="lab") as place:
        folder = Path(place)
        first_root = folder / "initramfs"
        busybox = Path(program("busybox"))
        first_root.write_bytes(initramfs.build(busybox, kernel.modules, job))
        sockets = Sockets(folder / "line", folder / "monitor", folder / "debug")
        machine = Machine(command(kernel, first_root, sockets))
        try:
            run = Follower(sockets.debugger, is_shown=is_shown)
            return run.follow(machine, [one.name for one in scenarios])
        finally:
            machine.close()


class ReadConsole(Protocol):
    """What is read of a machine."""

    def processor_seconds(self) -> float:
        """Return the processor time of the host that it has taken [s]."""
        ...

    def line(self, until_ns: int) -> str | None:
        """Return the next line; None at its end, TimeoutError after `until_ns`."""
        ...


class Follower:
    """Reads a machine's console to its end; what has not come then has hung."""

    def __init__(self, debugger: Path, *, is_shown: bool) -> None:
        self._debugger = debugger
        self._is_shown = is_shown
        self._results: list[ScenarioResult] = []
        self._running = "boot"
        self._is_over = False
        self._until_ns = 0
        self._taken_before = 0.0
        self._own: list[str] = []  # what the machine says beside messages

    def follow(
        self, machine: ReadConsole, names: Sequence[str]
    ) -> list[ScenarioResult]:
        """Return a result for each of the scenarios `names` that has begun."""
        self._allow(BOOT_LIMIT)
        try:
            while (line := machine.line(self._until_ns)) is not None:
                self._take(line, machine)
        except TimeoutError:
            self._own.append("[the time limit ended the machine]")
        done = {result.name for result in self._results}
        if not (self._is_over and done >= set(names)):
            words = "\n".join(self._own[-40:])
            reason = "the machine ended or hung in it"
            lost = ScenarioResult(self._running, Verdict.HUNG, 0.0, {}, reason, words)
            self._add(lost)
        return self._results

    def _take(self, line: str, machine: ReadConsole) -> None:
        match from_line(line):
            case Begun(name):
                self._running = name
                self._taken_before = machine.processor_seconds()
                self._allow(LIMIT)
            case TimerAddresses(offsets, events):
                timer_rate.correct(self._debugger, offsets, events, SLOWNESS)
            case Finished():
                self._is_over = True
            case ScenarioResult() as result:
                taken = machine.processor_seconds() - self._taken_before
                self._add(replace(result, processor=round(taken, 1)))
            case None:
                self._own.append(line)
                if self._is_shown:
                    print(line, flush=True)

    def _allow(self, wall: float) -> None:
        """Begin a time limit [s] anew."""
        self._until_ns = _CLOCK.now_ns() + int(wall * NS_PER_S)

    def _add(self, result: ScenarioResult) -> None:
        self._results.append(result)
        print(report.result_line(result), flush=True)
        if not result.verdict.is_fine:
            print("\n".join(f"    {line}" for line in result.output.splitlines()))
            if "\n" in result.reason:
                print(result.reason)


if __name__ == "__main__":
    sys.exit(main())
