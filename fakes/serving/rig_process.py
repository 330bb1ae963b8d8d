"""The simulated rig as a process: bus on a socket, sensor on a pseudo-terminal."""

import select
import signal
import tempfile
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.ipc.channel import Channel, ChannelClosedError
from acquisition.ipc.child import ChildContext, name_process
from acquisition.ipc.requests import Dispatcher
from acquisition.ipc.simulation import AskDevices, simulation_handlers
from acquisition.sample import Record
from acquisition.simulation import ServedDevices
from acquisition.temporary_folders import temporary_folder
from fakes.bus.hub import SocketHub
from fakes.pucks.wire import WiredNetwork
from fakes.sensor.kinds import plug
from fakes.sensor.network import UdpDevice
from fakes.sensor.pty import SerialPty
from fakes.truth import Truth, truth_records
from fakes.world.plain_world import simulated_rig
from fakes.world.rig import LocalSimulation
from fakes.world_clock import TICK_NS, WorldClock
from wam.model.constants import load_constants

PRIORITY = 70
TRUTH_ROWS = 50  # in one answer; the bus waits while it is sent
LINGER_NS = 5_000_000_000  # for the driver to idle the arm if the console dies


class PtyCable:
    """Implements `fakes.world.faults.Cable` over a pseudo-terminal or loopback."""

    def __init__(self, pty: SerialPty | UdpDevice, clock: WorldClock) -> None:
        self._pty = pty
        self._clock = clock

    def unplug(self) -> None:
        """Unplug the cable."""
        self._pty.unplug()

    def plug_in(self) -> None:
        """Plug the cable in again."""
        self._pty.plug_in(self._clock.now_ns())


class RigServer:
    """Server of one simulated rig and its control handle for a session's processes."""

    def __init__(
        self,
        simulation: LocalSimulation,
        clock: WorldClock,
        folder: Path,
        channel: Channel,
    ) -> None:
        self._clock = clock
        self._rig = rig = simulation.rig
        self._wired = WiredNetwork(rig.network, is_far=True)
        self._channel = channel
        self._hub = SocketHub(folder / "can")
        now_ns = self._clock.now_ns()
        choice = rig.scene.sensor
        self._pty = plug(choice, self._rig.stream, now_ns, folder / "sensor")
        rig.lay_cable(PtyCable(self._pty, clock))
        self._can_path = folder / "can"
        self._dispatcher = Dispatcher(
            simulation_handlers(simulation, self._truth_part),
            {AskDevices: self.devices},
        )

    def devices(self) -> ServedDevices:
        """Return the addresses of bus and sensor."""
        channel = str(self._can_path)
        return ServedDevices("traction-fake", channel, 1_000_000, self._pty.path)

    def serve(self) -> None:
        """Serve until the console hangs up and the arm's driver has left the bus."""
        try:
            try:
                while True:
                    if self._step(self._channel.fileno()):
                        self._dispatcher.answer(self._channel)
            except ChannelClosedError:
                end_ns = self._clock.now_ns() + LINGER_NS
            while self._hub.clients and self._clock.now_ns() < end_ns:
                self._step(None)
        finally:
            self._hub.close()
            self._pty.close()

    def _step(self, request_fd: int | None) -> bool:
        """Wait for input or an event; return whether `request_fd` is readable."""
        watched = [self._hub.fileno()]
        watched += [self._pty.fileno()] if self._pty.is_plugged_in else []
        if request_fd is not None:
            watched.append(request_fd)
        ready = select.select(watched, [], [], self._wait_time())[0]
        now_ns = self._clock.advance_to_now()
        self._carry_frames(now_ns)
        self._pty.advance(now_ns)
        self._rig.plant.advance(now_ns)
        return request_fd in ready

    def _carry_frames(self, now_ns: int) -> None:
        for can_id, data in self._hub.receive():
            self._wired.send(now_ns, can_id, data)
        for _, can_id, data in self._wired.advance(now_ns):
            self._hub.send(can_id, data)

    def _truth_part(self) -> Record:
        """Return the oldest rows not yet returned; an empty record is the end."""
        plant, frame = self._rig.plant, self._rig.scene.frame
        part = plant.truth.take(TRUTH_ROWS) if plant.truth is not None else Truth()
        if not part.t_ns:
            plant.take_truth()
        return truth_records(part, frame)

    def _wait_time(self) -> float:
        """Return the time until the next planned event [s]."""
        events = [self._wired.next_event_ns(), self._pty.next_event_ns()]
        times = [t for t in events if t is not None]
        now_ns = self._clock.advance_to_now()
        wait_ns = min([t - now_ns for t in times], default=TICK_NS)
        return max(0, min(wait_ns, TICK_NS)) * 1e-9


def main(station: ChildContext) -> None:
    """Serve a simulated rig until the console hangs up."""
    name_process("traction-fake")
    # After the console has died, the driver still has to idle the arm.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    request(RealtimeRequest(PRIORITY, station.settings.get("core")))
    with temporary_folder("traction", Path(tempfile.gettempdir())) as folder:
        clock = WorldClock(SystemClock())
        simulation = simulated_rig(station.settings, load_constants(), clock)
        RigServer(simulation, clock, folder, station.channel).serve()
