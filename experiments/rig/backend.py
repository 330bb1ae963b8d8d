"""The interface between the console and the devices, in this process or in others."""

import os
from contextlib import suppress
from typing import Protocol

from acquisition.clock import Clock
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.realtime import Grant
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.loop_client import LoopClient
from acquisition.ipc.requests import Answer, Dispatcher, Request
from acquisition.recording.recorder import Recorder, TrialRecording
from experiments.rig.arm_service import ArmService


class RigBackend(Protocol):
    """Arm, sensor, loop and recorder as the console uses them.

    Attributes:
        loop_client: the console's side of the loop.
    """

    loop_client: LoopClient

    @property
    def recorder(self) -> TrialRecording:
        """What writes the trials."""
        ...

    @property
    def recorder_pid(self) -> int:
        """Number of the process that writes them."""
        ...

    def ask(self, request: Request[Answer]) -> Answer:
        """Return the answer of arm or sensor to one of `experiments.rig.requests`.

        For the time in which the loop does not run; raises what the request says.
        """
        ...

    def sensor_metadata(self) -> dict[str, str]:
        """Return what became of the sensor's samples since it was opened, as text."""
        ...

    def begin(self) -> None:
        """Let the loop run from here on."""
        ...

    def grants(self) -> dict[str, list[Grant]]:
        """Return what the kernel granted to each process."""
        ...

    def idle(self) -> bool:
        """Idle the arm whatever has happened; return whether that is confirmed."""
        ...

    def safety_mode(self) -> SafetyMode:
        """Return the safety module's newest mode."""
        ...

    def close(self) -> None:
        """Idle the arm if it got torques, and end everything; safe to repeat."""
        ...


_GATHERED = 130  # cycles that the recorder in this thread writes at once, 0.26 s


class InlineAdvance:
    """Loop and recorder in this thread: nothing runs unless the console waits.

    The recorder drains as often as it would flush anyway: a process of its own drains
    every 20 ms, but here one long piece of work costs half of many short ones, and it
    is the simulation that waits for it.
    """

    def __init__(self, loop: Loop, recorder: Recorder) -> None:
        self._loop = loop
        self._recorder = recorder
        self._passed = 0

    def step(self) -> None:
        """Run one cycle, whatever has become of the recorder."""
        self._loop.step()

    def __call__(self, cycles: int) -> None:
        """Run the loop for `cycles` periods; drain the recorder when it is time."""
        self._loop.run(cycles)
        self._passed += cycles
        if self._passed >= _GATHERED:
            self._passed = 0
            self._recorder.drain()
        if self._recorder.failure is not None:
            raise self._recorder.failure


class InProcessBackend:
    """Arm, sensor, loop and recorder in this thread, on any clock."""

    def __init__(self, shared: SharedLayout, clock: Clock, service: ArmService) -> None:
        self._service = service
        self._dispatcher = Dispatcher(service.handlers())
        self._shared = shared
        self._clock = clock
        self.recorder = Recorder(shared, clock)
        self._advance_loop: InlineAdvance | None = None  # once the loop runs
        self.loop_client = LoopClient(shared, clock, self._advance)

    @property
    def recorder_pid(self) -> int:
        """Number of this process, which writes the trials too."""
        return os.getpid()

    def ask(self, request: Request[Answer]) -> Answer:
        """Return the answer of arm or sensor; see `experiments.rig.requests`."""
        return self._dispatcher.carry_out(request)

    def sensor_metadata(self) -> dict[str, str]:
        """Return what became of the sensor's samples since it was opened, as text."""
        return self._service.stream_metadata()

    def begin(self) -> None:
        """Let the loop run from here on, whenever the console waits."""
        self._service.begin()
        loop_server = self._service.loop_server
        assert loop_server is not None
        loop = Loop(loop_server, self._clock, stats=loop_server.stats)
        self._advance_loop = InlineAdvance(loop, self.recorder)
        self.loop_client.beat()

    def grants(self) -> dict[str, list[Grant]]:
        """Return nothing: this thread asks for nothing."""
        return {}

    def idle(self) -> bool:
        """Idle the arm; return whether that is confirmed.

        A loop that runs is asked for it: an arm idled behind its back would look as if
        the pendant had been pressed.
        """
        if self._advance_loop is not None:
            with suppress(Exception):  # of a loop that fails the arm is taken away
                self.loop_client.request(ArmState.IDLE)
                self._advance_loop.step()
                return self.loop_client.status.state is ArmState.IDLE
        return self._service.idle()

    def safety_mode(self) -> SafetyMode:
        """Return the safety module's newest mode."""
        return self._service.safety_mode()

    def close(self) -> None:
        """Idle the arm if it got torques, give bus and port back; safe to repeat."""
        self.recorder.abandon()
        self._service.close()
        self._shared.close()

    def _advance(self, cycles: int) -> None:
        """Let `cycles` periods of the loop pass."""
        if self._advance_loop is None:
            raise RuntimeError("the loop does not run yet")
        self._advance_loop(cycles)
