"""Early ends of a session: a requested stop, or a fault of the arm."""

import signal
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field

from acquisition.clock import NS_PER_S, Clock, SystemClock
from acquisition.control_loop.faults import GuardVerdict

URGENT_NS = 3 * NS_PER_S  # two requests closer than this: stop now
INTERRUPTED = 130  # exit code of a stop requested outside a session


class StopRequestedError(Exception):
    """The operator requested a stop: Ctrl-C, SIGTERM, or [q]uit."""


class UndoRequestedError(Exception):
    """The operator undoes the newest verdict in time."""


class ArmFaultError(Exception):
    """The guard stopped the arm.

    Attributes:
        verdict: verdict of the guard.
    """

    def __init__(self, verdict: GuardVerdict) -> None:
        super().__init__(verdict.reason)
        self.verdict = verdict


@dataclass(slots=True)
class StopFlag:
    """Counter of stop requests; set by signal handlers, read every tick.

    Attributes:
        clock: real time, even in a simulation.
        count: number of requests.
        is_urgent: two requests within 3 s: the arm stops before anything else.
    """

    clock: Clock = field(default_factory=SystemClock)
    count: int = 0
    is_urgent: bool = False
    _requested_ns: int = 0

    def request(self, *_: object) -> None:
        """Count one more request; also a signal handler."""
        now = self.clock.now_ns()
        self.is_urgent |= self.count > 0 and now - self._requested_ns <= URGENT_NS
        self.count += 1
        self._requested_ns = now


@contextmanager
def handle_signals(stop: StopFlag, *, is_service: bool = False) -> Generator[None]:
    """Turn Ctrl-C, SIGTERM and a lost terminal into requests to stop.

    A service started with SIGHUP ignored, as by nohup, outlives its terminal.
    """
    numbers = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
    if is_service and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        numbers.remove(signal.SIGHUP)
    before = [signal.signal(number, stop.request) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
