"""Who takes part in a session beside the rig, and how they end it."""

import signal
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

from acquisition.clock import NS_PER_S, Clock, SystemClock
from acquisition.control_loop.faults import GuardVerdict
from experiments.fault_injection.plan import Faults
from experiments.operator.console import Console
from experiments.operator.prompts import OperatorInput, SimulatedHand

TWICE_NS = 3 * NS_PER_S  # two requests closer than this mean: now


class StopRequestedError(Exception):
    """The person asked to stop: Ctrl-C, SIGTERM, or [q]uit."""


class ArmFaultError(Exception):
    """The guard stopped the arm.

    Attributes:
        verdict: its decision.
    """

    def __init__(self, verdict: GuardVerdict) -> None:
        super().__init__(verdict.reason)
        self.verdict = verdict


@dataclass(slots=True)
class StopFlag:
    """How often a stop was asked for; set by signal handlers, read every tick.

    Attributes:
        clock: the person's time, which is never the simulated one.
        count: how often.
        is_urgent: twice within 3 s: the arm first, whatever is still being finished.
    """

    clock: Clock = field(default_factory=SystemClock)
    count: int = 0
    is_urgent: bool = False
    _asked_ns: int = 0

    def ask(self, *_: object) -> None:
        """Ask once more."""
        now = self.clock.now_ns()
        self.is_urgent |= self.count > 0 and now - self._asked_ns <= TWICE_NS
        self.count += 1
        self._asked_ns = now


@contextmanager
def signals_ask(stop: StopFlag) -> Generator[None]:
    """Let Ctrl-C, SIGTERM and a lost terminal ask for a stop while this lasts."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, stop.ask) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


@dataclass(slots=True)
class Company:
    """Who takes part beside the rig: keys, simulated hand, console, stop, faults."""

    keys: OperatorInput
    console: Console
    stop: StopFlag
    hand: SimulatedHand | None = None
    faults: Faults | None = None
