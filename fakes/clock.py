"""Stepped time: waiting is what makes the simulated world go on."""

from typing import Protocol

from acquisition.clock import Readable

START_NS = 1_000_000_000_000
EPOCH_UTC_NS = 1_800_000_000_000_000_000  # 2027-01-15T08:00:00Z


class World(Protocol):
    """Simulated devices that are driven by a given time."""

    def advance(self, t_ns: int) -> None:
        """Let everything happen that happens up to `t_ns`."""
        ...

    def next_event_ns(self) -> int | None:
        """Return when a device says something next, None if never."""
        ...


class SteppedClock:
    """Implements acquisition.clock.Clock without the machine's time.

    Start and epoch are fixed, so two runs with the same seed have the same times.

    Attributes:
        lag_ns: so late a sleep ends, as on a computer that is busy elsewhere [ns].
    """

    def __init__(self) -> None:
        self._now_ns = START_NS
        self._world: World | None = None
        self.lag_ns = 0

    def attach(self, world: World) -> None:
        """Let `world` go on while a caller waits; it needs the clock to be made."""
        self._world = world

    def now_ns(self) -> int:
        """Return the simulated monotonic time [ns]."""
        return self._now_ns

    def utc_ns(self) -> int:
        """Return the simulated UTC [ns]."""
        return self._now_ns - START_NS + EPOCH_UTC_NS

    def sleep_until(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`."""
        if t_ns > self._now_ns:
            self._go_to(t_ns + self.lag_ns)

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Go from event to event until `link` is readable or `deadline_ns` comes."""
        while not link.is_readable():
            event = self._world.next_event_ns() if self._world else None
            if event is None or event > deadline_ns:
                if deadline_ns > self._now_ns:
                    self._go_to(deadline_ns)
                return link.is_readable()
            self._go_to(max(event, self._now_ns + 1))
        return True

    def _go_to(self, t_ns: int) -> None:
        self._now_ns = t_ns
        if self._world is not None:
            self._world.advance(t_ns)
