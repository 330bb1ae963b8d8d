"""Interface between console and devices, in this process or in others."""

import os
from contextlib import suppress
from typing import Protocol

from acquisition.clock import Clock
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.realtime import GrantResult
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from acquisition.errors import TrialFileError
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
        """The recorder of trials."""
        ...

    @property
    def recorder_pid(self) -> int:
        """Process id of the recorder."""
        ...

    def ask(self, request: Request[Answer]) -> Answer:
        """Send a request of `experiments.rig.requests` to arm or sensor.

        Allowed only while the loop is stopped; raises what the request raises.
        """
        ...

    def sensor_metadata(self) -> dict[str, str]:
        """Return counters of the sensor's stream since it was opened, as text."""
        ...

    def begin(self) -> None:
        """Start the loop."""
        ...

    @property
    def is_controlled(self) -> bool:
        """Whether the loop runs, and with it the control of the arm."""
        ...

    def grants(self) -> dict[str, list[GrantResult]]:
        """Return the scheduling rights granted to each process."""
        ...

    def idle(self) -> bool:
        """Idle the arm in any state; returns whether that is confirmed."""
        ...

    def safety_mode(self) -> SafetyMode:
        """Return the latest mode of the safety module."""
        ...

    def close(self) -> None:
        """Idle the arm if torques were sent, and end all processes; safe to repeat."""
        ...


_DRAIN_CYCLES = 130  # between drains of the recorder in this thread, 0.26 s


class InlineLoop:
    """Loop and recorder in this thread: both run only while the console waits.

    The recorder drains at its flush period, not every 20 ms as in its own process: one
    long drain takes half the time of many short ones, and the simulation waits for it.
    """

    def __init__(self, loop: Loop, recorder: Recorder) -> None:
        self._loop = loop
        self._recorder = recorder
        self._passed = 0
        self._raised: TrialFileError | None = None

    def step(self) -> None:
        """Run one cycle, even if the recorder has failed."""
        self._loop.step()

    def __call__(self, cycles: int) -> None:
        """Run the loop for `cycles` periods; drain the recorder when due.

        Raises:
            TrialFileError: the recorder has failed; once, the arm is still to be held.
        """
        self._loop.run(cycles)
        self._passed += cycles
        if self._passed >= _DRAIN_CYCLES:
            self._passed = 0
            self._recorder.drain()
        failure = self._recorder.failure
        if failure is not None and failure is not self._raised:
            self._raised = failure
            raise failure


class InProcessBackend:
    """Arm, sensor, loop and recorder in this thread, on any clock."""

    def __init__(self, shared: SharedLayout, clock: Clock, service: ArmService) -> None:
        self._service = service
        self._dispatcher = Dispatcher(service.handlers())
        self._shared = shared
        self._clock = clock
        self.recorder = Recorder(shared, clock)
        self._advance_loop: InlineLoop | None = None  # once the loop runs
        self.loop_client = LoopClient(shared, clock, self._advance)

    @property
    def recorder_pid(self) -> int:
        """Id of this process, which also writes the trials."""
        return os.getpid()

    def ask(self, request: Request[Answer]) -> Answer:
        """Execute a request of `experiments.rig.requests`."""
        return self._dispatcher.carry_out(request)

    def sensor_metadata(self) -> dict[str, str]:
        """Return counters of the sensor's stream since it was opened, as text."""
        return self._service.stream_metadata()

    def begin(self) -> None:
        """Start the loop, which runs whenever the console waits."""
        self._service.begin()
        loop_server = self._service.loop_server
        assert loop_server is not None
        loop = Loop(loop_server, self._clock, stats=loop_server.stats)
        self._advance_loop = InlineLoop(loop, self.recorder)
        self.loop_client.beat()

    @property
    def is_controlled(self) -> bool:
        """Whether the loop runs, and with it the control of the arm."""
        return self._advance_loop is not None

    def grants(self) -> dict[str, list[GrantResult]]:
        """Return no grants: this thread requests none."""
        return {}

    def idle(self) -> bool:
        """Idle the arm; returns whether that is confirmed.

        A running loop idles the arm itself: if anything else idled the arm, the loop
        would take it for a press of the pendant.
        """
        if self._advance_loop is not None:
            with suppress(Exception):  # the loop failed: idle the arm directly
                self.loop_client.request(ArmState.IDLE)
                self._advance_loop.step()
                return self.loop_client.status.state is ArmState.IDLE
        return self._service.idle()

    def safety_mode(self) -> SafetyMode:
        """Return the latest mode of the safety module."""
        return self._service.safety_mode()

    def close(self) -> None:
        """Idle the arm if torques were sent, close bus and port; safe to repeat."""
        self.recorder.abandon()
        self._service.close()
        self._shared.close()

    def _advance(self, cycles: int) -> None:
        """Run `cycles` periods of the loop."""
        if self._advance_loop is None:
            raise RuntimeError("the loop does not run yet")
        self._advance_loop(cycles)
