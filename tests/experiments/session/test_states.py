import pytest

from acquisition.control_loop.states import TRANSITIONS
from experiments.session.states import OPEN, TABLE, Event, SessionPhase
from tests.experiments.program import traction

# (phase, event): the possible next phases; any other pair is refused.
LEADS = {
    ("planned", "session-started"): "preflight",
    ("preflight", "activated"): "ready",
    ("preflight", "noted"): "preflight",
    ("preflight", "session-ended"): "unfinished complete",
    ("preflight", "crash-found"): "crashed",
    ("ready", "tared"): "ready",
    ("ready", "paused"): "paused",
    ("ready", "trial-set-aside"): "ready",
    ("ready", "trial-started"): "recording",
    ("ready", "verdict-changed"): "ready",
    ("ready", "noted"): "ready",
    ("ready", "session-ended"): "unfinished complete",
    ("ready", "crash-found"): "crashed",
    ("paused", "continued"): "ready",
    ("paused", "noted"): "paused",
    ("paused", "session-ended"): "unfinished complete",
    ("paused", "crash-found"): "crashed",
    ("recording", "trial-recorded"): "review",
    ("recording", "trial-rejected"): "ready",
    ("recording", "noted"): "recording",
    ("recording", "session-ended"): "crashed",
    ("recording", "crash-found"): "crashed",
    ("review", "trial-kept"): "ready",
    ("review", "trial-rejected"): "ready",
    ("review", "noted"): "review",
    ("review", "session-ended"): "crashed",
    ("review", "crash-found"): "crashed",
    ("unfinished", "session-resumed"): "preflight",
    ("unfinished", "redo-started"): "preflight",
    ("unfinished", "verdict-changed"): "unfinished complete",
    ("unfinished", "noted"): "unfinished",
    ("unfinished", "session-closed"): "closed",
    ("complete", "redo-started"): "preflight",
    ("complete", "verdict-changed"): "unfinished complete",
    ("complete", "noted"): "complete",
    ("closed", "session-resumed"): "preflight",
    ("closed", "redo-started"): "preflight",
    ("closed", "verdict-changed"): "closed complete",
    ("closed", "noted"): "closed",
    ("crashed", "session-resumed"): "preflight",
    ("crashed", "redo-started"): "preflight",
    ("crashed", "trial-rejected"): "crashed",
    ("crashed", "verdict-changed"): "crashed",
    ("crashed", "noted"): "crashed",
    ("crashed", "session-ended"): "unfinished complete",
    ("crashed", "session-closed"): "closed",
}
PAIRS = [(phase, event) for phase in SessionPhase for event in Event]


@pytest.mark.parametrize(("phase", "event"), PAIRS)
def test_every_event_leads_to_its_phase_or_is_refused_with_a_reason(phase, event):
    step = TABLE[phase, event]
    assert " ".join(step.to) == LEADS.get((phase, event), "")
    assert bool(step.refused) is not bool(step.to)


def test_the_table_has_every_pair_once_and_nothing_else():
    assert sorted(TABLE) == sorted(PAIRS)
    assert set(LEADS) <= set(TABLE)


def test_a_crash_can_be_found_in_every_open_phase_and_in_no_other():
    found = {p for p in SessionPhase if TABLE[p, Event.CRASH_FOUND].to}
    assert found == OPEN


def test_the_program_prints_the_whole_table():
    done = traction("check", "--explain", "states")
    lines = done.out.splitlines()
    assert (done.code, len(lines)) == (0, len(PAIRS) + len(TRANSITIONS))
    assert "ready       trial-started    -> recording" in lines
    assert "complete    session-resumed  refused: the session is complete" in lines
