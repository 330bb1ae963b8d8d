"""The time of a simulated world that other processes see on the wall clock."""

from acquisition.clock import PERIOD_NS, Clock, Readable

TICK_NS = PERIOD_NS  # a served world goes on at least this often
_LONGEST_STEP_NS = 10 * TICK_NS


class WorldClock:
    """Implements acquisition.clock.Clock: the machine's time without its stalls.

    A process that the kernel did not run for long must not look like a lost heartbeat
    or a fall of the arm, so a single step of the world is never longer than 20 ms.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._world_ns = self._machine_ns = clock.now_ns()

    def now_ns(self) -> int:
        """Return the world's time [ns], as it was when `go_on` was called last."""
        return self._world_ns

    def utc_ns(self) -> int:
        """Return UTC [ns since 1970] of the machine."""
        return self._clock.utc_ns()

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the world's time may have come to `t_ns`."""
        self._clock.sleep_until(self._on_machine(t_ns))

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Return True when `link` has something to read, False at the deadline."""
        return self._clock.wait(link, self._on_machine(deadline_ns))

    def go_on(self) -> int:
        """Let the world's time pass and return it."""
        now_ns = self._clock.now_ns()
        self._world_ns += min(now_ns - self._machine_ns, _LONGEST_STEP_NS)
        self._machine_ns = now_ns
        return self._world_ns

    def _on_machine(self, t_ns: int) -> int:
        return t_ns - self._world_ns + self._machine_ns
