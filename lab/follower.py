"""Reads a machine's console and enforces time limits."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from acquisition.clock import NS_PER_S, SystemClock
from lab import report
from lab.results import (
    AllFinished,
    ScenarioResult,
    ScenarioStarted,
    TimerLocation,
    Verdict,
    from_line,
)

# Limits of processor time [s] until the first scenario begins, and for each scenario.
# Unlike wall time, it does not run out while a busy host gives the machine no time.
BOOT_LIMIT = 300.0
LIMIT = 1500.0
PANICKED = "the machine's kernel panicked in it"
_LAST_LINES = 100  # lines kept of a lost machine's output; an oops has 60
_IDLE_SHARE = 0.02  # share of processor time below which a machine counts as stopped
_CLOCK = SystemClock()


class ReadConsole(Protocol):
    """Interface of a machine to its follower."""

    def processor_seconds(self) -> float:
        """Return the host's processor time used by the machine [s]."""
        ...

    def line(self, until_ns: int) -> str | None:
        """Return the next line; None at the end, TimeoutError after `until_ns`."""
        ...

    def correct_timer(self, found: TimerLocation) -> None:
        """Set the true rate of the local timer in the machine's kernel."""
        ...


class Follower:
    """Reads a machine's console to its end; unfinished scenarios have hung."""

    def __init__(self, *, is_shown: bool) -> None:
        """`is_shown`: also print the machine's own output."""
        self._is_shown = is_shown
        self._results: list[ScenarioResult] = []
        self._running = "boot"
        self._is_over = False
        self._until_ns = 0
        self._limit = 0.0  # s of processor time
        self._used_before = 0.0  # s, at the start of the limit
        self._used_at_check = 0.0  # s since then, at the last check of a silent machine
        self._output: list[str] = []  # lines that are no messages

    def follow(
        self, machine: ReadConsole, names: Sequence[str]
    ) -> list[ScenarioResult]:
        """Return a result for each scenario of `names` that has begun."""
        self._allow(BOOT_LIMIT, 0.0)
        try:
            while (line := self._next(machine)) is not None:
                self._process(line, machine)
        except TimeoutError:
            self._output.append("[the time limit ended the machine]")
        done = {result.name for result in self._results}
        if not (self._is_over and done >= set(names)):
            output = "\n".join(self._output[-_LAST_LINES:])
            has_panicked = "Kernel panic" in output
            reason = PANICKED if has_panicked else "the machine ended or hung in it"
            lost = ScenarioResult(self._running, Verdict.HUNG, 0.0, {}, reason, output)
            self._add(lost)
        return self._results

    def _next(self, machine: ReadConsole) -> str | None:
        """Return the next line; None at the end.

        Raises:
            TimeoutError: the processor time is used up, or the machine is idle.
        """
        while True:
            try:
                return machine.line(self._until_ns)
            except TimeoutError:
                used = machine.processor_seconds() - self._used_before
                recent, self._used_at_check = used - self._used_at_check, used
                if used >= self._limit or recent < _IDLE_SHARE * self._limit:
                    raise
                self._until_ns = _CLOCK.now_ns() + int(self._limit * NS_PER_S)

    def _process(self, line: str, machine: ReadConsole) -> None:
        match from_line(line):
            case ScenarioStarted(name):
                self._running = name
                self._allow(LIMIT, machine.processor_seconds())
            case TimerLocation() as timer:
                machine.correct_timer(timer)
            case AllFinished():
                self._is_over = True
            case ScenarioResult() as result:
                used = machine.processor_seconds() - self._used_before
                self._add(replace(result, processor=round(used, 1)))
            case None:
                self._output.append(line)
                if self._is_shown:
                    print(line, flush=True)

    def _allow(self, limit: float, used_before: float) -> None:
        """Start a new limit [s of processor time]."""
        self._limit, self._used_before, self._used_at_check = limit, used_before, 0.0
        self._until_ns = _CLOCK.now_ns() + int(limit * NS_PER_S)

    def _add(self, result: ScenarioResult) -> None:
        self._results.append(result)
        print(report.result_line(result), flush=True)
        if not result.verdict.is_fine:
            print("\n".join(f"    {line}" for line in result.output.splitlines()))
            if "\n" in result.reason:
                print(result.reason)
