"""A simulated arm behind each kind of bus, on stepped time."""

from itertools import count

import can

from fakes.bus.client import SocketBus
from fakes.bus.hub import CanPort, SocketHub
from fakes.pucks.network import PuckNetwork
from fakes.serving.puck_server import PuckServer
from tests.fakes.stepped import Motors, Rig, SteppedClock

COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
FIRMWARE = (100, 128, 200)  # one of 65-124, of 125-131, of 132 and later
_channels = count()


class InProcess:
    def __init__(self, options, _folder):
        self._rig = Rig(options, COUNTS)
        self.motors, self.bus = self._rig.motors, self._rig.bus
        self.press, self.rest = self._rig.network.pendant, self._rig.rest

    def close(self):
        self.bus.shutdown()


class LimitedClock(SteppedClock):
    """Waits no longer than its limit, whatever the deadline."""

    limit_ns = 0

    def wait(self, link, deadline_ns):
        return super().wait(link, min(deadline_ns, self.limit_ns))


class Served:
    """A server on stepped time; the kernel delivers its frames at once."""

    def __init__(self, options, port):
        self.clock, self.motors = LimitedClock(), Motors(COUNTS)
        network = PuckNetwork(self.motors, options, self.clock.t_ns)
        self.server = PuckServer(network, self.motors, port, self.clock)
        self.press = self.server.press

    def rest(self, duration_ns):
        self.clock.limit_ns = self.clock.t_ns + duration_ns
        self.server.step()
        while self.clock.t_ns < self.clock.limit_ns:
            self.server.step()

    def close(self):
        self.bus.shutdown()
        self.server.close()


class OnSocket(Served):
    def __init__(self, options, folder):
        super().__init__(options, SocketHub(folder / "bus"))
        self.bus = SocketBus(str(folder / "bus"))


class OnVirtual(Served):
    def __init__(self, options, _folder):
        channel = f"contract-{next(_channels)}"
        super().__init__(options, CanPort("virtual", channel, 1_000_000))
        self.bus = can.Bus(interface="virtual", channel=channel)


BUSES = (InProcess, OnSocket, OnVirtual)
