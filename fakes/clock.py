"""Stepped time: waiting advances the simulated world."""

from typing import Protocol

from acquisition.clock import Readable

START_NS = 1_000_000_000_000
EPOCH_UTC_NS = 1_800_000_000_000_000_000  # 2027-01-15T08:00:00Z


class World(Protocol):
    """Simulated devices, functions of the given time."""

    def advance(self, t_ns: int) -> None:
        """Advance to `t_ns`."""
        ...

    def next_event_ns(self) -> int | None:
        """Return the time of the next output of a device, None if there is none."""
        ...


class SteppedClock:
    """Simulated clock; implements acquisition.clock.Clock.

    Start and epoch are fixed, so runs with the same seed have the same times.

    Attributes:
        lag_ns: delay of the end of a sleep, as on a busy computer [ns].
    """

    def __init__(self) -> None:
        self._now_ns = START_NS
        self._world: World | None = None
        self.lag_ns = 0

    def attach(self, world: World) -> None:
        """Set the world to advance while a caller waits."""
        self._world = world

    def now_ns(self) -> int:
        """Return the simulated monotonic time [ns]."""
        return self._now_ns

    def utc_ns(self) -> int:
        """Return the simulated UTC [ns]."""
        return self._now_ns - START_NS + EPOCH_UTC_NS

    def sleep_until(self, t_ns: int) -> None:
        """Advance the world to `t_ns`."""
        if t_ns > self._now_ns:
            self._advance_to(t_ns + self.lag_ns)

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Advance from event to event until `link` is readable or at `deadline_ns`."""
        while not link.is_readable():
            event = self._world.next_event_ns() if self._world else None
            if event is None or event > deadline_ns:
                if deadline_ns > self._now_ns:
                    self._advance_to(deadline_ns)
                return link.is_readable()
            self._advance_to(max(event, self._now_ns + 1))
        return True

    def _advance_to(self, t_ns: int) -> None:
        self._now_ns = t_ns
        if self._world is not None:
            self._world.advance(t_ns)
