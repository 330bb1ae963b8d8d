"""Loop side of the shared memory: executes commands, publishes status, supervises."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from acquisition.clock import RATE_HZ
from acquisition.control_loop.cycle import Cycle
from acquisition.control_loop.faults import Fault, verdict_for
from acquisition.control_loop.loop import LoopStats, Tick
from acquisition.control_loop.states import ArmState
from acquisition.control_loop.timing import pack_timing
from acquisition.devices import Arm
from acquisition.ipc.commands import (
    AwaitActivation,
    CommandQueue,
    EnterState,
    LeaveLoop,
    LoopStatus,
    MoveJoints,
    PostedCommand,
    SetBias,
    StartPoweredTest,
    StatusSlot,
    WatchTrial,
)
from acquisition.ipc.layout import ProcessRole, SharedLayout

MS = 1_000_000
SILENT_NS = 500 * MS  # without a heartbeat of console or recorder: hold
NO_HEARTBEAT_NS = 60_000 * MS  # without a heartbeat of the console: bell
ORPHAN_NS = 1_000 * MS  # hold after the death of the console, then idle
_FACTS_EVERY = _SOUND_EVERY = RATE_HZ  # cycles, once a second

# Bound once: an Enum member lookup takes longer than the comparison.
_CONSOLE, _CONTROL, _RECORDER = (
    ProcessRole.CONSOLE,
    ProcessRole.CONTROL,
    ProcessRole.RECORDER,
)

MetadataSource = Callable[[], Mapping[str, str]]


def no_sound() -> None:
    """Make no sound."""


@dataclass(frozen=True, slots=True)
class LoopHooks:
    """Services of the machine for the loop.

    Attributes:
        now_ns: returns the monotonic time [ns].
        metadata: returns the metadata of the devices; called once a second.
        sound: sounds a bell for a person.
    """

    now_ns: Callable[[], int]
    metadata: MetadataSource
    sound: Callable[[], None] = no_sound


class LoopServer:
    """Wraps a cycle: executes commands, publishes status, supervises other processes.

    Attributes:
        is_over: the loop must end after this cycle.
    """

    def __init__(
        self, cycle: Cycle, arm: Arm, shared: SharedLayout, hooks: LoopHooks
    ) -> None:
        self.is_over = False
        self._is_orphaned = False
        self.stats = LoopStats()
        self._cycle = cycle
        self._arm = arm
        self._shared = shared
        self._hooks = hooks
        self._commands = CommandQueue(shared.commands)
        self._status_slot = StatusSlot(shared.status)
        self._status = LoopStatus(is_running=True, control=cycle.status)
        self._cycles = 0
        self._orphaned_ns = 0

    def __call__(self, tick: Tick) -> None:
        """Execute commands, run one cycle, and publish its results."""
        for posted in self._commands.take():
            self._execute(posted)
        self._watch(tick.now_ns)
        self._cycle(tick)
        self._cycles += 1
        if self._cycles % _FACTS_EVERY == 1:
            self._publish_metadata()
        self._publish(tick)

    def leave(self) -> None:
        """Publish that the loop has ended."""
        self._status.is_running = False
        self._status_slot.write(self._status)

    def _execute(self, posted: PostedCommand) -> None:
        cycle = self._cycle
        match posted.command:
            case EnterState(state, known):
                cycle.request(state, known)
            case AwaitActivation(known):
                cycle.start(known)
            case WatchTrial(is_recording):
                cycle.is_recording = is_recording
                self._publish_metadata()
            case SetBias(bias):
                cycle.set_bias(bias)
            case MoveJoints(goal, speed):
                cycle.move_to(goal, speed)
            case StartPoweredTest(goal):
                cycle.start_powered_test(goal)
            case LeaveLoop():
                self.is_over = True
        self._status.obeyed = posted.number

    def _publish_metadata(self) -> None:
        self._shared.health.write(json.dumps(dict(self._hooks.metadata())).encode())

    def on_console_death(self) -> None:
        """React to the death of the console: hold, then idle, then end the loop."""
        self._is_orphaned = True

    def _watch(self, now_ns: int) -> None:
        """Watchdog of console and recorder: hold if a heartbeat times out."""
        heartbeats = self._shared.heartbeats
        console_ns = now_ns - heartbeats.last_ns(_CONSOLE)
        if console_ns > SILENT_NS:
            self._cycle.report(verdict_for(Fault.CONSOLE_SILENT))
            if console_ns > NO_HEARTBEAT_NS and self._cycles % _SOUND_EVERY == 0:
                self._hooks.sound()
        if (
            self._cycle.is_recording
            and now_ns - heartbeats.last_ns(_RECORDER) > SILENT_NS
        ):
            self._cycle.report(verdict_for(Fault.RECORDER_SILENT))
        if self._is_orphaned:
            self._idle_alone(now_ns)

    def _idle_alone(self, now_ns: int) -> None:
        """Hold, then idle the arm and end the loop, without a console."""
        if not self._orphaned_ns:
            self._orphaned_ns = now_ns
            self._cycle.report(verdict_for(Fault.CONSOLE_LOST))
        elif now_ns - self._orphaned_ns > ORPHAN_NS:
            self._cycle.request(ArmState.IDLE)
            self.is_over = True

    def _publish(self, tick: Tick) -> None:
        status, stats = self._status, self.stats
        status.control = self._cycle.status
        status.bus_condition = self._arm.bus_condition
        status.cycles = self._cycles
        status.skipped, status.late = stats.skipped, stats.late
        status.worst_late_ns = stats.worst_late_ns
        self._status_slot.write(status)
        now_ns = self._hooks.now_ns()
        self._shared.heartbeats.beat(_CONTROL, now_ns)
        self._shared.timings.write(
            pack_timing(tick, self._cycle.replies_ns, self._arm.sent_ns, now_ns)
        )
