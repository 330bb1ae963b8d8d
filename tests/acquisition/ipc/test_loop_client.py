import numpy as np
import pytest

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.faults import Fault, ForceAge, verdict_for
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.ipc.commands import (
    CommandQueue,
    EnterState,
    LoopStatus,
    MoveJoints,
    SetBias,
    StatusSlot,
)
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.ipc.loop_client import LoopClient
from fakes.clock import SteppedClock

STOPPED = verdict_for(Fault.FT_STALE, ForceAge(26.0, 20.0))


class Room:
    """A client whose loop obeys every command, or none."""

    def __init__(self):
        self.clock = SteppedClock()
        self.shared = SharedLayout.create()
        self.queue = CommandQueue(self.shared.commands)
        self.status = LoopStatus(is_running=True)
        self.is_obeying = True
        self.passed = []
        self.loop_client = LoopClient(self.shared, self.clock, self.let_pass)
        self.commands = []

    def let_pass(self, cycles):
        self.passed.append(cycles)
        self.clock.sleep_until(self.clock.now_ns() + cycles * PERIOD_NS)
        if not self.is_obeying:
            return
        for number, command in self.queue.take():
            self.commands.append(command)
            self.status.obeyed = number
            if isinstance(command, EnterState):
                self.status.control = ControlStatus(command.state)
        StatusSlot(self.shared.status).write(self.status)


@pytest.fixture
def room():
    return Room()


def test_time_passes_in_slices_with_a_console_heartbeat_in_each(room):
    room.loop_client.advance(0.05)
    assert room.passed == [10, 10, 5]
    beat_ns = room.shared.heartbeats.last_ns(ProcessRole.CONSOLE)
    assert beat_ns == room.clock.now_ns() - 5 * PERIOD_NS


def test_at_least_one_cycle_passes(room):
    room.loop_client.advance(0.0)
    assert room.passed == [1]


def test_a_requested_state_is_reported(room):
    room.loop_client.request(ArmState.FLOAT)
    room.loop_client.advance(0.02)
    assert room.loop_client.status.state is ArmState.FLOAT


def test_a_verdict_from_before_the_request_is_ignored(room):
    room.status.control = ControlStatus(ArmState.HOLD, verdict=STOPPED)
    room.loop_client.advance(0.02)
    assert room.loop_client.status.verdict == STOPPED
    room.is_obeying = False
    room.loop_client.request(ArmState.HOLD)
    room.loop_client.advance(0.02)
    assert room.loop_client.status.verdict is None


def test_idle_is_confirmed_by_the_loop(room):
    assert room.loop_client.idle()
    assert room.loop_client.status.state is ArmState.IDLE


def test_idle_without_a_reply_is_not_confirmed(room):
    room.status.control = ControlStatus(ArmState.FLOAT)
    room.loop_client.advance(0.02)
    room.is_obeying = False
    start_ns = room.clock.now_ns()
    assert not room.loop_client.idle(0.5)
    # One portion of 20 ms more than asked for at most.
    assert room.clock.now_ns() - start_ns <= 520_000_000


def test_observers_run_after_every_slice(room):
    looks = []
    room.loop_client.on_tick.append(lambda: looks.append(room.clock.now_ns()))
    room.loop_client.advance(0.04)
    assert len(looks) == 2


def test_goals_and_biases_are_posted_as_given(room):
    room.loop_client.move_to(np.arange(7.0), 0.25)
    room.loop_client.set_bias([1, 2, 3, 4, 5, 6])
    room.loop_client.advance(0.02)
    assert room.commands[0] == MoveJoints((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 0.25)
    assert room.commands[1] == SetBias((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
