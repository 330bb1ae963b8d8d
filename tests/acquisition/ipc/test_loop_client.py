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


class ClientBench:
    """A client whose loop obeys every command, or none."""

    def __init__(self):
        self.clock = SteppedClock()
        self.shared = SharedLayout.create()
        self.queue = CommandQueue(self.shared.commands)
        self.status = LoopStatus(is_running=True)
        self.is_obeying = True
        self.passed = []
        self.loop_client = LoopClient(self.shared, self.clock, self.run_loop)
        self.commands = []

    def run_loop(self, cycles):
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
def bench():
    return ClientBench()


def test_time_passes_in_slices_with_a_console_heartbeat_in_each(bench):
    bench.loop_client.advance(0.05)
    assert bench.passed == [10, 10, 5]
    beat_ns = bench.shared.heartbeats.last_ns(ProcessRole.CONSOLE)
    assert beat_ns == bench.clock.now_ns() - 5 * PERIOD_NS


def test_at_least_one_cycle_passes(bench):
    bench.loop_client.advance(0.0)
    assert bench.passed == [1]


def test_a_requested_state_is_reported(bench):
    bench.loop_client.request(ArmState.FLOAT)
    bench.loop_client.advance(0.02)
    assert bench.loop_client.status.state is ArmState.FLOAT


def test_a_verdict_from_before_the_request_is_ignored(bench):
    bench.status.control = ControlStatus(ArmState.HOLD, verdict=STOPPED)
    bench.loop_client.advance(0.02)
    assert bench.loop_client.status.verdict == STOPPED
    bench.is_obeying = False
    bench.loop_client.request(ArmState.HOLD)
    bench.loop_client.advance(0.02)
    assert bench.loop_client.status.verdict is None


def test_idle_is_confirmed_by_the_loop(bench):
    assert bench.loop_client.idle()
    assert bench.loop_client.status.state is ArmState.IDLE


def test_idle_without_a_reply_is_not_confirmed(bench):
    bench.status.control = ControlStatus(ArmState.FLOAT)
    bench.loop_client.advance(0.02)
    bench.is_obeying = False
    start_ns = bench.clock.now_ns()
    assert not bench.loop_client.idle(0.5)
    # At most one slice of 20 ms more than requested.
    assert bench.clock.now_ns() - start_ns <= 520_000_000


def test_observers_run_after_every_slice(bench):
    times = []
    bench.loop_client.on_tick.append(lambda: times.append(bench.clock.now_ns()))
    bench.loop_client.advance(0.04)
    assert len(times) == 2


def test_goals_and_biases_are_posted_as_given(bench):
    bench.loop_client.move_to(np.arange(7.0), 0.25)
    bench.loop_client.set_bias([1, 2, 3, 4, 5, 6])
    bench.loop_client.advance(0.02)
    assert bench.commands[0] == MoveJoints((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 0.25)
    assert bench.commands[1] == SetBias((1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
