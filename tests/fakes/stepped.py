"""A stepped clock, and motors that only store positions and torques."""

from collections.abc import Sequence
from weakref import finalize

from acquisition.clock import Readable
from fakes.bus.in_process import FakeCanBus
from fakes.pucks.ft_puck import Load
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from wam.bus.link import CanLink
from wam.bus.transports import PythonCanTransport


class SteppedClock:
    """Simulated time: waiting advances the world without wall-clock time."""

    def __init__(self) -> None:
        self.world: FakeCanBus | None = None
        self.t_ns = 1_000_000_000

    def now_ns(self) -> int:
        return self.t_ns

    def utc_ns(self) -> int:
        return self.t_ns

    def sleep_until(self, t_ns: int) -> None:
        self.t_ns = max(self.t_ns, t_ns)
        if self.world is not None:
            self.world.advance(self.t_ns)

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        while not link.is_readable():
            if self.t_ns >= deadline_ns:
                return False
            next_ns = self.world.next_event_ns() if self.world else None
            self.sleep_until(min(deadline_ns, next_ns or deadline_ns))
        return True


class Motors:
    """Seven motors that stay where they are put."""

    def __init__(self, counts: Sequence[int] = (0,) * 7) -> None:
        self.position = list(counts)
        self.units = [0] * 7
        self.shorted = [True] * 7
        self.t_ns = 0

    def advance(self, t_ns: int) -> None:
        assert t_ns >= self.t_ns, "time runs forward"
        self.t_ns = t_ns

    def counts(self) -> Sequence[int]:
        return self.position

    def set_torques(self, units: Sequence[int]) -> None:
        self.units = list(units)

    @property
    def is_idle(self) -> bool:
        return all(self.shorted)

    def short_windings(self, shorted: Sequence[bool]) -> None:
        self.shorted = list(shorted)


class Rig:
    """Motors, network, bus, clock and link, joined."""

    def __init__(
        self,
        options: NetworkOptions | None = None,
        counts: Sequence[int] = (0,) * 7,
        load: Load | None = None,
    ) -> None:
        self.clock = SteppedClock()
        self.motors = Motors(counts)
        self.network = PuckNetwork(self.motors, options, self.clock.t_ns, load)
        self.bus = FakeCanBus(self.network, self.clock)
        self.clock.world = self.bus
        self.sent: list[tuple[int, int, bytes]] = []
        self.link = CanLink(PythonCanTransport(self.bus, self.clock))
        finalize(self, self.bus.shutdown)
        send = self.link.send

        def spy(can_id: int, data: bytes) -> None:
            self.sent.append((self.clock.t_ns, can_id, data))
            send(can_id, data)

        self.link.send = spy

    def rest(self, duration_ns: int) -> None:
        self.clock.sleep_until(self.clock.t_ns + duration_ns)
