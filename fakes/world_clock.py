"""Clock of a simulated world that is served to other processes in real time."""

from acquisition.clock import PERIOD_NS, Clock, Readable

TICK_NS = PERIOD_NS  # longest interval between two advances of a served world
_LONGEST_STEP_NS = 10 * TICK_NS


class WorldClock:
    """Machine time without stalls; implements acquisition.clock.Clock.

    A stall of this process must not look like a lost heartbeat or a falling arm, so a
    single step of the world never exceeds 20 ms.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._world_ns = self._machine_ns = clock.now_ns()

    def now_ns(self) -> int:
        """Return the world's time at the last call of `advance_to_now` [ns]."""
        return self._world_ns

    def utc_ns(self) -> int:
        """Return UTC [ns since 1970] of the machine."""
        return self._clock.utc_ns()

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until the world's time can have reached `t_ns`."""
        self._clock.sleep_until(self._machine_time(t_ns))

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Wait for data; return True if `link` is readable, False at the deadline."""
        return self._clock.wait(link, self._machine_time(deadline_ns))

    def advance_to_now(self) -> int:
        """Advance the world's time and return it."""
        now_ns = self._clock.now_ns()
        self._world_ns += min(now_ns - self._machine_ns, _LONGEST_STEP_NS)
        self._machine_ns = now_ns
        return self._world_ns

    def _machine_time(self, t_ns: int) -> int:
        return t_ns - self._world_ns + self._machine_ns
