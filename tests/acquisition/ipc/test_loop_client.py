import numpy as np
import pytest

from acquisition.control_loop.guard import Action, Verdict
from acquisition.control_loop.loop import PERIOD_NS
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.ipc.commands import Kind, LoopStatus, Mailbox, StatusBoard
from acquisition.ipc.layout import Board, Role
from acquisition.ipc.loop_client import Desk
from fakes.clock import SteppedClock

STOPPED = Verdict(Action.HOLD, "ft-stale")


class Room:
    """A desk whose loop obeys every command, or does not."""

    def __init__(self):
        self.clock = SteppedClock()
        self.board = Board.create()
        self.mailbox = Mailbox(self.board.commands)
        self.status = LoopStatus(is_running=True)
        self.is_obeying = True
        self.passed = []
        self.desk = Desk(self.board, self.clock, self.let_pass)
        self.commands = []

    def let_pass(self, cycles):
        self.passed.append(cycles)
        self.clock.sleep_until(self.clock.now_ns() + cycles * PERIOD_NS)
        if not self.is_obeying:
            return
        for command in self.mailbox.take():
            self.commands.append(command)
            self.status.obeyed = command.number
            if command.kind is Kind.ENTER:
                self.status.control = ControlStatus(ArmState(command.argument))
        StatusBoard(self.board.status).write(self.status)


@pytest.fixture
def room():
    return Room()


def test_time_passes_in_portions_and_the_console_beats_in_each(room):
    room.desk.advance(0.05)
    assert room.passed == [10, 10, 5]
    beat_ns = room.board.beats.last_ns(Role.CONSOLE)
    assert beat_ns == room.clock.now_ns() - 5 * PERIOD_NS


def test_at_least_one_cycle_passes(room):
    room.desk.advance(0.0)
    assert room.passed == [1]


def test_a_state_that_was_asked_for_is_seen(room):
    room.desk.request(ArmState.FLOAT)
    room.desk.advance(0.02)
    assert room.desk.status.state is ArmState.FLOAT


def test_a_verdict_from_before_the_request_is_not_believed(room):
    room.status.control = ControlStatus(ArmState.HOLD, verdict=STOPPED)
    room.desk.advance(0.02)
    assert room.desk.status.verdict == STOPPED
    room.is_obeying = False
    room.desk.request(ArmState.HOLD)
    room.desk.advance(0.02)
    assert room.desk.status.verdict is None


def test_idle_is_confirmed_by_the_loop(room):
    assert room.desk.idle()
    assert room.desk.status.state is ArmState.IDLE


def test_idle_without_an_answer_is_not_confirmed(room):
    room.status.control = ControlStatus(ArmState.FLOAT)
    room.desk.advance(0.02)
    room.is_obeying = False
    start_ns = room.clock.now_ns()
    assert not room.desk.idle(0.5)
    # One portion of 20 ms more than asked for at most.
    assert room.clock.now_ns() - start_ns <= 520_000_000


def test_observers_look_after_every_portion(room):
    looks = []
    room.desk.on_pass.append(lambda: looks.append(room.clock.now_ns()))
    room.desk.advance(0.04)
    assert len(looks) == 2


def test_goals_and_biases_are_posted_as_given(room):
    room.desk.move_to(np.arange(7.0), 0.25)
    room.desk.set_bias([1, 2, 3, 4, 5, 6])
    room.desk.advance(0.02)
    assert room.commands[0].values[:8] == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.25)
    assert room.commands[1].values[:6] == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
