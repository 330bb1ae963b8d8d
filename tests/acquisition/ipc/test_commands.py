from dataclasses import fields
from typing import get_args

import pytest

from acquisition.control_loop.faults import (
    FAULTS,
    Action,
    CircuitCauses,
    Fault,
    GuardVerdict,
)
from acquisition.control_loop.powered_tests import PoweredTestGoal, PoweredTestKind
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import SafetyMode
from acquisition.ipc.commands import (
    AwaitActivation,
    Command,
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
from acquisition.ipc.layout import SharedLayout


@pytest.fixture(scope="module")
def shared():
    return SharedLayout.create()


COMMANDS = [
    EnterState(ArmState.FLOAT, 3),
    AwaitActivation(4),
    WatchTrial(True),
    WatchTrial(False),
    SetBias((1.0, -2.0, 3.5, 0.0, 0.25, 6.0)),
    MoveJoints((0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7), 0.25),
    StartPoweredTest(PoweredTestGoal(PoweredTestKind.RAMP, 4, -1.5, 2.0)),
    LeaveLoop(),
]


def test_commands_arrive_in_order_with_their_numbers(shared):
    loop, console = CommandQueue(shared.commands), CommandQueue(shared.commands)
    numbers = [console.post(command) for command in COMMANDS]
    taken = loop.take()
    assert [posted.command for posted in taken] == COMMANDS
    assert [posted.number for posted in taken] == numbers
    assert numbers == list(range(numbers[0], numbers[0] + len(COMMANDS)))


def test_every_command_has_its_example():
    assert {type(command) for command in COMMANDS} == {*get_args(Command)}


def test_a_command_is_consumed_once(shared):
    loop, console = CommandQueue(shared.commands), CommandQueue(shared.commands)
    console.post(LeaveLoop())
    assert len(loop.take()) == 1
    assert loop.take() == []


def test_a_loop_that_begins_later_does_not_obey_old_commands(shared):
    console = CommandQueue(shared.commands)
    console.post(EnterState(ArmState.FLOAT, 0))
    assert CommandQueue(shared.commands).take() == []


def test_command_numbers_continue_with_a_later_console(shared):
    CommandQueue(shared.commands).post(LeaveLoop())
    console = CommandQueue(shared.commands)
    before = console.posted
    assert console.post(LeaveLoop()) == before + 1


def example(detail):
    """Return a detail of that type with different numbers in all of its fields."""
    if detail is CircuitCauses:
        return detail(("velocity", "torque"))
    return detail(*(n + 0.5 for n, _ in enumerate(fields(detail), 1)))


@pytest.mark.parametrize(
    "verdict",
    [
        None,
        GuardVerdict(Action.IDLE, Fault.E_STOP, CircuitCauses(("velocity", "torque"))),
        *(
            GuardVerdict(spec.actions[0], fault, example(spec.detail))
            for fault, spec in FAULTS.items()
        ),
    ],
)
def test_the_status_round_trips(shared, verdict):
    control = ControlStatus(ArmState.HOLD, SafetyMode.ACTIVE, verdict, -5)
    status = LoopStatus(7, True, True, 1000, 3, 12, 9_000_000, control)
    StatusSlot(shared.status).write(status)
    assert StatusSlot(shared.status).read() == status


def test_before_the_loop_runs_the_status_is_idle():
    status = StatusSlot(SharedLayout.create().status).read()
    assert (status.control.state, status.is_running) == (ArmState.IDLE, False)
