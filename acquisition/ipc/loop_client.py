"""The console's side of the loop: let time pass, ask for states, see the newest."""

import json
from collections.abc import Callable, Sequence
from typing import Protocol

from acquisition.clock import NS_PER_S, PERIOD_NS, Clock
from acquisition.control_loop.proof import ProofGoal
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.ipc.commands import (
    AwaitActivation,
    CommandQueue,
    EnterState,
    GiveProof,
    LeaveLoop,
    LoopStatus,
    MoveJoints,
    SetBias,
    StatusSlot,
    WatchTrial,
)
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.ipc.ring_buffer import RingBufferReader
from acquisition.sample import Record

PORTION = 10  # cycles between two looks of the console: 20 ms


class Advance(Protocol):
    """How time passes for the console."""

    def __call__(self, cycles: int) -> None:
        """Return when `cycles` periods have passed.

        Raises:
            TractionError: the loop, the recorder or another process is in trouble.
        """
        ...


class LoopClient:
    """What the console has of the loop, wherever it runs.

    Attributes:
        advance_cycles: lets a number of cycles pass.
        on_tick: called after every 20 ms that pass.
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
        """The loop's newest status."""
        return self._status_slot.read()

    @property
    def status(self) -> ControlStatus:
        """State of the arm and the verdicts that stand."""
        loop = self.loop
        if loop.obeyed < self._asked and loop.control.number <= self._known:
            loop.control.clear()  # known when the request was made
        return loop.control

    def note(self, control: ControlStatus) -> None:
        """Take the verdicts of a status as known: they are told, or acted on.

        The loop refuses a request for torques by who does not know the newest one.
        """
        self._known = max(self._known, control.number)

    def is_news(self, control: ControlStatus) -> bool:
        """Return whether a verdict stands that is not known yet."""
        return control.verdict is not None and control.number > self._known

    @property
    def late_cycles(self) -> int:
        """Cycles that began late since the start."""
        return self.loop.late

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass, at least one cycle; the loop sees that we are alive."""
        left = max(1, round(seconds * NS_PER_S / PERIOD_NS))
        while left > 0:
            portion = min(left, PORTION)
            self.beat()
            self.advance_cycles(portion)
            left -= portion
            for look in self.on_tick:
                look()

    def beat(self) -> None:
        """Show the loop that the console is alive."""
        self._shared.heartbeats.beat(ProcessRole.CONSOLE, self._clock.now_ns())

    def request(self, state: ArmState) -> None:
        """Ask the loop for a state of the arm; see `Cycle.request`."""
        self._asked = self._commands.post(EnterState(state, self._known))

    def start(self) -> None:
        """Ask the loop to hold, until a person activates the arm; see `Cycle.start`."""
        self._asked = self._commands.post(AwaitActivation(self._known))

    def idle(self, seconds: float = 1.0) -> bool:
        """Ask for idle and wait; return whether the arm is confirmed idle."""
        self.request(ArmState.IDLE)
        end_ns = self._clock.now_ns() + int(seconds * NS_PER_S)
        while self._clock.now_ns() < end_ns and self.loop.is_running:
            self.advance(PORTION * PERIOD_NS / NS_PER_S)
            loop = self.loop
            if loop.obeyed >= self._asked and loop.control.state is ArmState.IDLE:
                return True
        return self.status.state is ArmState.IDLE

    def move_to(self, goal: Sequence[float], speed: float) -> None:
        """Ask for a move to joint positions `goal` [rad], seven; only in hold.

        No joint is faster than `speed` [rad/s] on the way.
        """
        self._asked = self._commands.post(MoveJoints(tuple(goal), speed))

    def prove(self, goal: ProofGoal) -> None:
        """Ask for a proof, in hold."""
        self._asked = self._commands.post(GiveProof(goal))

    def set_bias(self, bias: Sequence[float]) -> None:
        """Tell the loop what the sensor reads without load [N, N m], six numbers."""
        self._commands.post(SetBias(tuple(bias)))

    def watch_trial(self, *, is_recording: bool) -> None:
        """Switch the guard's limits for a running trial on or off."""
        self._commands.post(WatchTrial(is_recording))

    def leave(self) -> None:
        """Ask the loop to end."""
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
