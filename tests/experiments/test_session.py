import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.session import SessionState, apply, replay

START = {"event": "session-started", "terrain": "S0", "trials": 2}


def event(name, trial):
    return {"event": f"trial-{name}", "trial": trial}


def attempt(trial, verdict):
    return [event("started", trial), event(verdict, trial)]


numbers = st.one_of(
    st.integers(-1, 4), st.none(), st.booleans(), st.text(max_size=2), st.floats()
)
events = st.lists(
    st.one_of(
        st.builds(event, st.sampled_from(["started", "kept", "rejected"]), numbers),
        st.fixed_dictionaries(
            {"event": st.sampled_from(["session-started", "session-ended", "tared"])},
            optional={
                "terrain": st.text(max_size=2),
                "trials": numbers,
                "reason": numbers,
            },
        ),
        st.just(START),
        st.dictionaries(st.text(max_size=3), numbers, max_size=2),
    ),
    max_size=30,
)


def check_possible(state):
    attempts = dict(state.attempts)
    assert len(set(state.kept)) == len(state.kept)
    assert all(number >= 1 for number in attempts)
    assert set(state.kept) <= set(attempts)  # nothing is kept that never started
    running = 0 if state.running is None else 1
    assert sum(attempts.values()) >= len(state.kept) + state.rejected + running
    assert state.running not in state.kept
    assert state.running is None or attempts[state.running] >= 1
    assert not (attempts and not state.terrain)
    assert not (state.ended and not state.terrain)
    assert not (state.ended and running)
    assert state.next_trial not in state.kept


@given(events)
def test_no_journal_leads_to_an_impossible_state(journal):
    state = SessionState()
    for entry in [START, *journal]:
        state = apply(state, entry)
        check_possible(state)


@given(events)
def test_no_journal_without_a_start_leads_anywhere_impossible(journal):
    check_possible(replay(journal))


@given(events, st.integers(0, 30))
def test_a_journal_can_be_replayed_in_two_parts(journal, cut):
    state = replay([START, *journal[:cut]])
    for entry in journal[cut:]:
        state = apply(state, entry)
    assert state == replay([START, *journal])


def test_a_session_is_complete_when_enough_trials_were_kept():
    state = replay([START, *attempt(1, "kept")])
    assert not state.is_complete
    state = replay([START, *attempt(1, "kept"), *attempt(2, "kept")])
    assert state.is_complete
    assert state.kept == (1, 2)


def test_a_rejected_trial_is_done_again_under_its_number():
    state = replay([START, *attempt(1, "rejected")])
    assert (state.next_trial, state.attempt(1), state.rejected) == (1, 1, 1)
    state = replay([START, *attempt(1, "rejected"), *attempt(1, "kept")])
    assert (state.next_trial, state.attempt(1), state.kept) == (2, 2, (1,))


@pytest.mark.parametrize(
    "journal",
    [
        [event("kept", 1)],
        [event("started", 1), event("kept", 2)],
        [event("started", 1), event("started", 2)],
        [{"event": "session-ended", "reason": "complete"}, event("started", 1)],
    ],
)
def test_impossible_events_change_nothing(journal):
    assert replay([START, *journal]) == replay([START, journal[0]])


def test_a_second_start_changes_nothing():
    again = {"event": "session-started", "terrain": "B0", "trials": 9}
    assert replay([START, again]) == replay([START])


def test_an_end_closes_the_running_trial():
    end = {"event": "session-ended", "reason": "fault"}
    state = replay([START, event("started", 1), end])
    assert (state.ended, state.running) == ("fault", None)
