"""Reads what a machine says on its console, and times it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from acquisition.clock import NS_PER_S, SystemClock
from lab import report
from lab.results import (
    Begun,
    Finished,
    ScenarioResult,
    TimerFound,
    Verdict,
    from_line,
)

# s of processor time (of wall time, too, on an idle host): until the first scenario
# begins, and for each. A machine that a busy host gives less of it does not hang.
BOOT_LIMIT = 300.0
LIMIT = 1500.0
PANICKED = "the machine's kernel panicked in it"
_LAST_WORDS = 100  # lines of a machine that is lost; an oops has 60
_STANDS_STILL = 0.02  # share of the time, below which a machine does nothing at all
_CLOCK = SystemClock()


class ReadConsole(Protocol):
    """What is read of a machine."""

    def processor_seconds(self) -> float:
        """Return the processor time of the host that it has taken [s]."""
        ...

    def line(self, until_ns: int) -> str | None:
        """Return the next line; None at its end, TimeoutError after `until_ns`."""
        ...

    def correct_timer(self, found: TimerFound) -> None:
        """Tell its kernel the true rate of its local timer."""
        ...


class Follower:
    """Reads a machine's console to its end; what has not come then has hung."""

    def __init__(self, *, is_shown: bool) -> None:
        """Begin; `is_shown`: the machine's own output is printed, too."""
        self._is_shown = is_shown
        self._results: list[ScenarioResult] = []
        self._running = "boot"
        self._is_over = False
        self._until_ns = 0
        self._limit = 0.0  # s of processor time
        self._taken_before = 0.0  # s of it, until the limit began
        self._waited = 0.0  # s of it, until the last look at a silent machine
        self._own: list[str] = []  # what the machine says beside messages

    def follow(
        self, machine: ReadConsole, names: Sequence[str]
    ) -> list[ScenarioResult]:
        """Return a result for each of the scenarios `names` that has begun."""
        self._allow(BOOT_LIMIT, 0.0)
        try:
            while (line := self._next(machine)) is not None:
                self._take(line, machine)
        except TimeoutError:
            self._own.append("[the time limit ended the machine]")
        done = {result.name for result in self._results}
        if not (self._is_over and done >= set(names)):
            words = "\n".join(self._own[-_LAST_WORDS:])
            has_panicked = "Kernel panic" in words
            reason = PANICKED if has_panicked else "the machine ended or hung in it"
            lost = ScenarioResult(self._running, Verdict.HUNG, 0.0, {}, reason, words)
            self._add(lost)
        return self._results

    def _next(self, machine: ReadConsole) -> str | None:
        """Return the next line; None at the end.

        Raises:
            TimeoutError: it had the processor time of its limit, or wants none.
        """
        while True:
            try:
                return machine.line(self._until_ns)
            except TimeoutError:
                taken = machine.processor_seconds() - self._taken_before
                waited, self._waited = taken - self._waited, taken
                if taken >= self._limit or waited < _STANDS_STILL * self._limit:
                    raise
                self._until_ns = _CLOCK.now_ns() + int(self._limit * NS_PER_S)

    def _take(self, line: str, machine: ReadConsole) -> None:
        match from_line(line):
            case Begun(name):
                self._running = name
                self._allow(LIMIT, machine.processor_seconds())
            case TimerFound() as found:
                machine.correct_timer(found)
            case Finished():
                self._is_over = True
            case ScenarioResult() as result:
                taken = machine.processor_seconds() - self._taken_before
                self._add(replace(result, processor=round(taken, 1)))
            case None:
                self._own.append(line)
                if self._is_shown:
                    print(line, flush=True)

    def _allow(self, limit: float, taken_before: float) -> None:
        """Begin a time limit [s of processor time] anew."""
        self._limit, self._taken_before, self._waited = limit, taken_before, 0.0
        self._until_ns = _CLOCK.now_ns() + int(limit * NS_PER_S)

    def _add(self, result: ScenarioResult) -> None:
        self._results.append(result)
        print(report.result_line(result), flush=True)
        if not result.verdict.is_fine:
            print("\n".join(f"    {line}" for line in result.output.splitlines()))
            if "\n" in result.reason:
                print(result.reason)
