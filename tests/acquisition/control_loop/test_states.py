import pytest

from acquisition.control_loop.faults import Action
from acquisition.control_loop.states import (
    REQUESTS,
    TRANSITIONS,
    VERDICTS,
    ArmEvent,
    ArmState,
    transition_lines,
)

# Rows: events; columns: idle, float, hold, damp, unknown, guide.
# "b" = idles, "." = nothing.
TABLE = """
idle requested            b b b b b b
float requested           F F F F F F
hold requested            H H H H H H
damp requested            D D D D D D
guide requested           G G G G G G
verdict: end trial        . . . . . .
verdict: hold             . H H . . H
verdict: damp             . D D . . D
verdict: idle             b b b b b b
idle confirmed            I I I I I I
idle not confirmed        U U U U U U
safety circuit is idle    . . . . b .
"""
LETTERS = {state: state.name[0] for state in ArmState}


def letter(transition):
    if transition.idles:
        return "b"
    return "." if transition.to is None else LETTERS[transition.to]


def test_every_transition_follows_the_table():
    rows = [
        f"{event.value:<25} "
        + " ".join(letter(TRANSITIONS[state, event]) for state in ArmState)
        for event in ArmEvent
    ]
    assert rows == TABLE.strip().splitlines()


def test_the_table_is_printed_pair_by_pair():
    lines = transition_lines()
    assert len(lines) == len(ArmState) * len(ArmEvent)
    assert "hold     verdict: damp             -> damp" in lines
    assert "damp     verdict: hold             -" in lines


@pytest.mark.parametrize("event", VERDICTS.values())
def test_no_verdict_releases_the_arm(event):
    """Idle and unknown arms get no torques, a damped one is not floated or held."""
    for state in (ArmState.IDLE, ArmState.DAMP, ArmState.UNKNOWN):
        assert TRANSITIONS[state, event].to is None


def test_every_state_but_unknown_can_be_requested():
    assert set(REQUESTS) == set(ArmState) - {ArmState.UNKNOWN}


def test_every_action_of_the_guard_is_an_event():
    assert set(VERDICTS) == set(Action) - {Action.NONE}


def test_states_keep_the_numbers_that_processes_exchange():
    numbers = {state.name: state.value for state in ArmState}
    assert numbers == {
        "IDLE": 0,
        "FLOAT": 1,
        "HOLD": 2,
        "DAMP": 3,
        "UNKNOWN": 4,
        "GUIDE": 5,
    }
