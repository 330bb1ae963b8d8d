import pytest

from acquisition.control_loop.states import TRANSITIONS
from experiments.session.states import OPEN, TABLE, Event, SessionPhase
from tests.experiments.program import traction

PAIRS = [(phase, event) for phase in SessionPhase for event in Event]


@pytest.mark.parametrize(("phase", "event"), PAIRS)
def test_every_event_leads_to_a_phase_or_is_refused_with_a_reason(phase, event):
    step = TABLE[phase, event]
    assert bool(step.refused) is not bool(step.to)


def test_the_table_has_every_pair_once_and_nothing_else():
    assert sorted(TABLE) == sorted(PAIRS)


def test_a_crash_can_be_found_in_every_open_phase_and_in_no_other():
    found = {p for p in SessionPhase if TABLE[p, Event.CRASH_FOUND].to}
    assert found == OPEN


def test_the_program_prints_the_whole_table():
    done = traction("check", "--explain", "states")
    lines = done.out.splitlines()
    assert (done.code, len(lines)) == (0, len(PAIRS) + len(TRANSITIONS))
    assert "ready       trial-started    -> recording" in lines
    assert "complete    session-resumed  refused: the session is complete" in lines
