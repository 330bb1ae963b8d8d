"""Server of a puck network for other programs, on the wall clock, in one thread."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from acquisition.clock import Clock
from acquisition.simulation import Hands, PendantAction
from fakes.bus.hub import CanPort, Frame, SocketHub
from fakes.pucks.bank import MotorSide
from fakes.pucks.network import PuckNetwork
from fakes.pucks.wire import WiredNetwork
from fakes.serving.sensor_server import SensorServer
from fakes.world_clock import TICK_NS, WorldClock

Tap = Callable[[int, bytes], None]


class Port(Protocol):
    """The bus as seen from the network: a Readable that carries the hosts' frames.

    Attributes:
        ignored: number of packets that were not classic data frames.
        lost: number of frames that a host did not read in time.
    """

    ignored: int
    lost: int

    @property
    def name(self) -> str:
        """The bus as INTERFACE:CHANNEL."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 = none."""
        ...

    def is_readable(self) -> bool:
        """Return whether frames have arrived."""
        ...

    def receive(self) -> list[Frame]:
        """Return the frames received from hosts; never waits."""
        ...

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame of the network; never waits."""
        ...

    def close(self) -> None:
        """Leave the bus."""
        ...


class PuckServer:
    """A network and the bus on which it is served.

    On any kind of bus, the devices' frames leave one after the other, as on a wire of
    1 Mbit/s.

    Attributes:
        network: the pucks.
        sensor: a serial wrist sensor served alongside; None = none.
        hands: hands that can move the arm; None = none.
    """

    def __init__(
        self,
        network: PuckNetwork,
        motors: MotorSide,
        port: Port,
        clock: Clock,
        sensor: SensorServer | None = None,
        hands: Hands | None = None,
    ) -> None:
        self.network = network
        self._wired = WiredNetwork(network, is_far=True)
        self._motors = motors
        self._port = port
        self._clock = WorldClock(clock)
        self.sensor = sensor
        self.hands = hands

    @property
    def name(self) -> str:
        """The bus as INTERFACE:CHANNEL."""
        if self.sensor is None:
            return self._port.name
        return f"{self._port.name}, {self.sensor.name}"

    @property
    def state(self) -> str:
        """The mode of the safety module as text."""
        return self.network.safety_mode.name.lower().replace("_", "-")

    @property
    def losses(self) -> str:
        """Report of ignored packets and lost frames; empty if there are none."""
        port = self._port
        reports = [self.sensor.losses] if self.sensor and self.sensor.losses else []
        if port.ignored or port.lost:
            reports.append(
                f"{port.ignored} packets were not classic data frames and were "
                f"ignored; {port.lost} frames were lost because the client did not "
                "read them in time."
            )
        return " ".join(reports)

    def press(self, action: PendantAction) -> None:
        """Press a button of the pendant now."""
        self._clock.advance_to_now()
        self.network.pendant(action)

    def step(self, tap: Tap | None = None) -> None:
        """Wait at most 2 ms for a frame or an event, then advance network and bus.

        Args:
            tap: called for every frame on the bus.

        Raises:
            LinkError: the bus failed.
        """
        self._clock.wait(self._port, self._deadline_ns())
        now_ns = self._clock.advance_to_now()
        for can_id, data in self._port.receive():
            if tap is not None:
                tap(can_id, data)
            self._wired.send(now_ns, can_id, data)
        for _, can_id, data in self._wired.advance(now_ns):
            self._port.send(can_id, data)
            if tap is not None:
                tap(can_id, data)
        # Advance the arm even if no host reads it: catching up would delay answers.
        self._motors.advance(now_ns)
        if self.sensor is not None:
            self.sensor.step()

    def close(self) -> None:
        """Leave the bus and unplug the sensor."""
        self._port.close()
        if self.sensor is not None:
            self.sensor.close()

    def _deadline_ns(self) -> int:
        now_ns, event_ns = self._clock.now_ns(), self._wired.next_event_ns()
        wait_ns = TICK_NS if event_ns is None else event_ns - now_ns
        return now_ns + max(0, min(wait_ns, TICK_NS))


def open_can_port(interface: str, channel: str, bitrate: int) -> Port:
    """Return the port on which a network is served.

    Raises:
        SettingsError: the socket's path is in use or cannot be one.
        LinkError: the bus cannot be opened.
    """
    if interface == "traction-fake":
        return SocketHub(Path(channel))
    return CanPort(interface, channel, bitrate)
