import pytest

from acquisition.control_loop.guard import Action, Verdict
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import SafetyMode
from acquisition.ipc.commands import Kind, LoopStatus, Mailbox, StatusBoard
from acquisition.ipc.layout import Board


@pytest.fixture(scope="module")
def board():
    return Board.create()


def test_commands_arrive_in_order_with_their_numbers(board):
    loop, console = Mailbox(board.commands), Mailbox(board.commands)
    first = console.post(Kind.ENTER, ArmState.FLOAT)
    console.post(Kind.MOVE, values=(0.1, 0.2))
    taken = loop.take()
    assert [command.kind for command in taken] == [Kind.ENTER, Kind.MOVE]
    assert [command.number for command in taken] == [first, first + 1]
    assert taken[0].argument == ArmState.FLOAT
    assert taken[1].values[:3] == (0.1, 0.2, 0.0)


def test_a_command_is_taken_once(board):
    loop, console = Mailbox(board.commands), Mailbox(board.commands)
    console.post(Kind.LEAVE)
    assert len(loop.take()) == 1
    assert loop.take() == []


def test_a_loop_that_begins_later_does_not_obey_old_commands(board):
    console = Mailbox(board.commands)
    console.post(Kind.ENTER, ArmState.FLOAT)
    assert Mailbox(board.commands).take() == []


def test_numbers_go_on_when_a_console_comes_later(board):
    Mailbox(board.commands).post(Kind.LEAVE)
    console = Mailbox(board.commands)
    before = console.posted
    assert console.post(Kind.LEAVE) == before + 1


@pytest.mark.parametrize(
    "verdict",
    [
        None,
        Verdict(Action.HOLD, "ft-stale", (("age", 26.5), ("limit", 20.0))),
        Verdict(Action.IDLE, "estop", causes=("velocity", "torque")),
    ],
)
def test_the_status_arrives_as_it_was_written(board, verdict):
    control = ControlStatus(ArmState.HOLD, SafetyMode.ACTIVE, verdict, -5)
    status = LoopStatus(7, True, True, 1000, 3, 12, 9_000_000, control)
    StatusBoard(board.status).write(status)
    assert StatusBoard(board.status).read() == status


def test_before_the_loop_runs_the_arm_is_idle_and_nothing_runs():
    status = StatusBoard(Board.create().status).read()
    assert (status.control.state, status.is_running) == (ArmState.IDLE, False)
