"""Console side of the loop: advance time, send commands, read status and samples."""

import json
from collections.abc import Callable, Sequence
from typing import Protocol

from acquisition.clock import NS_PER_S, PERIOD_NS, Clock
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.ipc.commands import (
    AwaitActivation,
    CommandQueue,
    EnterState,
    LeaveLoop,
    LoopStatus,
    MoveJoints,
    SetBias,
    StartPoweredTest,
    StatusSlot,
    WatchTrial,
)
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.ipc.ring_buffer import RingBufferReader
from acquisition.sample import Record

PORTION = 10  # cycles between two updates of the console: 20 ms


class Advance(Protocol):
    """Function that lets time pass for the console."""

    def __call__(self, cycles: int) -> None:
        """Return after `cycles` periods.

        Raises:
            TractionError: the loop, the recorder or another process has failed.
        """
        ...


class LoopClient:
    """Console's client of the loop, in this process or another.

    Attributes:
        advance_cycles: lets a number of cycles pass.
        on_tick: functions called every 20 ms.
    """

    def __init__(
        self, shared: SharedLayout, clock: Clock, advance_cycles: Advance
    ) -> None:
        self._shared = shared
        self._clock = clock
        self.advance_cycles = advance_cycles
        self._commands = CommandQueue(shared.commands)
        self._status_slot = StatusSlot(shared.status)
        self._asked = 0
        self._known = 0
        self.on_tick: list[Callable[[], None]] = []

    @property
    def loop(self) -> LoopStatus:
        """Newest status of the loop."""
        return self._status_slot.read()

    @property
    def status(self) -> ControlStatus:
        """State of the arm and the active verdicts."""
        loop = self.loop
        if loop.obeyed < self._asked and loop.control.number <= self._known:
            loop.control.clear()  # known at the request, about to be cleared by it
        return loop.control

    def note(self, control: ControlStatus) -> None:
        """Mark the verdicts of a status as known (reported, or acted on).

        The loop refuses a request for torques if the newest verdict is not known.
        """
        self._known = max(self._known, control.number)

    def is_news(self, control: ControlStatus) -> bool:
        """Return whether an active verdict is not yet known."""
        return control.verdict is not None and control.number > self._known

    @property
    def late_cycles(self) -> int:
        """Cycles that began late since the start."""
        return self.loop.late

    def advance(self, seconds: float) -> None:
        """Wait for `seconds`, at least one cycle, with heartbeats to the loop."""
        remaining = max(1, round(seconds * NS_PER_S / PERIOD_NS))
        while remaining > 0:
            portion = min(remaining, PORTION)
            self.beat()
            self.advance_cycles(portion)
            remaining -= portion
            for callback in self.on_tick:
                callback()

    def beat(self) -> None:
        """Send a heartbeat of the console."""
        self._shared.heartbeats.beat(ProcessRole.CONSOLE, self._clock.now_ns())

    def request(self, state: ArmState) -> None:
        """Request a state of the arm; see `Cycle.request`."""
        self._asked = self._commands.post(EnterState(state, self._known))

    def start(self) -> None:
        """Request hold until a person activates the arm; see `Cycle.start`."""
        self._asked = self._commands.post(AwaitActivation(self._known))

    def idle(self, seconds: float = 1.0) -> bool:
        """Request idle and wait; return whether idle is confirmed."""
        self.request(ArmState.IDLE)
        end_ns = self._clock.now_ns() + int(seconds * NS_PER_S)
        while self._clock.now_ns() < end_ns and self.loop.is_running:
            self.advance(PORTION * PERIOD_NS / NS_PER_S)
            loop = self.loop
            if loop.obeyed >= self._asked and loop.control.state is ArmState.IDLE:
                return True
        return self.status.state is ArmState.IDLE

    def move_to(self, goal: Sequence[float], speed: float) -> None:
        """Request a move to joint positions `goal` [rad], seven; only in hold.

        `speed` limits all joints [rad/s].
        """
        self._asked = self._commands.post(MoveJoints(tuple(goal), speed))

    def start_powered_test(self, goal: PoweredTestGoal) -> None:
        """Request a powered test, in hold."""
        self._asked = self._commands.post(StartPoweredTest(goal))

    def set_bias(self, bias: Sequence[float]) -> None:
        """Set the tare, taken in `experiments.run.tare`.

        Args:
            bias: the sensor's reading without load [N, N m], six numbers.
        """
        self._commands.post(SetBias(tuple(bias)))

    def watch_trial(self, *, is_recording: bool) -> None:
        """Switch the guard's limits for a running trial on or off."""
        self._commands.post(WatchTrial(is_recording))

    def leave(self) -> None:
        """Request the end of the loop."""
        self._commands.post(LeaveLoop())

    def last(self, seconds: float) -> Record:
        """Return the records of the last `seconds`, oldest first."""
        return self._shared.cycles.last(round(seconds * NS_PER_S / PERIOD_NS))

    def latest(self) -> Record:
        """Return the newest record, shape (1,); empty before the first cycle."""
        return self._shared.cycles.last(1)

    def wrenches(self) -> RingBufferReader:
        """Return a reader of the sensor's samples from now on."""
        return self._shared.wrenches.reader()

    def timings(self) -> RingBufferReader:
        """Return a reader of the loop's timings from now on."""
        return self._shared.timings.reader()

    def device_metadata(self) -> dict[str, str]:
        """Return the newest metadata of the devices."""
        return json.loads(self._shared.health.read() or b"{}")
