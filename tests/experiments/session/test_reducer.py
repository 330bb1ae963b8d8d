from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.session.reducer import SessionState, apply, refusal, replay
from experiments.session.states import OPEN, Event, SessionPhase

START = {"event": "session-started", "terrain": "S0", "trials": 2}
ACTIVE = {"event": "activated"}
END = {"event": "session-ended", "reason": "unfinished"}
BEGIN = (START, ACTIVE)


def event(name, trial=None, **fields):
    given = {"event": name, **fields}
    return given if trial is None else {**given, "trial": trial}


def attempt(trial, verdict):
    names = ("trial-started", "trial-recorded", f"trial-{verdict}")
    return [event(name, trial) for name in names]


def verdict(trial, number, what):
    return event("verdict-changed", trial, attempt=number, verdict=what)


numbers = st.one_of(
    st.integers(-1, 4), st.none(), st.booleans(), st.text(max_size=2), st.floats()
)
likely = st.sampled_from(
    [ACTIVE, END, *attempt(1, "kept"), *attempt(2, "kept"), *attempt(2, "rejected")]
)
events = st.lists(
    st.one_of(
        likely,
        st.fixed_dictionaries(
            {"event": st.sampled_from([str(name) for name in Event])},
            optional={
                "terrain": st.text(max_size=2),
                "trials": numbers,
                "trial": numbers,
                "attempt": numbers,
                "verdict": st.sampled_from(["keep", "reject", "", 1]),
                "reason": numbers,
            },
        ),
        st.just(START),
        st.dictionaries(st.text(max_size=3), numbers, max_size=2),
    ),
    max_size=40,
)


def check_possible(state):
    assert len(set(state.kept)) == len(state.kept)
    assert all(attempt.name.number >= 1 for attempt in state.attempts)
    # every kept attempt exists, and its latest verdict is keep
    named = {(a.name.number, a.name.attempt): a.verdict.verdict for a in state.attempts}
    kept = {pair for pair, verdict in named.items() if verdict == "keep"}
    assert kept == set(state.kept_attempts)
    running = 0 if state.running is None else 1
    # every attempt is kept, rejected or running
    assert len(state.attempts) == len(state.kept) + state.rejected + running
    assert state.running not in state.kept
    is_unjudged = state.phase in {
        SessionPhase.RECORDING,
        SessionPhase.REVIEW,
        SessionPhase.CRASHED,
    }
    assert state.running is None or is_unjudged
    assert (state.phase is SessionPhase.PLANNED) == (not state.terrain)
    assert state.ended == "" or state.phase not in OPEN
    assert (state.phase is SessionPhase.COMPLETE) <= state.is_complete
    assert state.next_trial not in state.kept or state.redoing is not None


@given(events)
def test_no_journal_leads_to_an_impossible_state(journal):
    state = SessionState()
    for entry in [*BEGIN, *journal]:
        state = apply(state, entry)
        check_possible(state)


@given(events)
def test_no_journal_without_a_start_leads_to_an_impossible_state(journal):
    check_possible(replay(journal))


@given(events, st.integers(0, 40))
def test_a_journal_can_be_replayed_in_two_parts(journal, cut):
    state = replay([*BEGIN, *journal[:cut]])
    for entry in journal[cut:]:
        state = apply(state, entry)
    assert state == replay([*BEGIN, *journal])


@given(events)
def test_only_a_verdict_or_setting_aside_removes_a_kept_trial(journal):
    states = [SessionState()]
    for entry in [*BEGIN, *attempt(1, "kept"), *journal]:
        states.append(apply(states[-1], entry))
    entries = [*BEGIN, *attempt(1, "kept"), *journal]
    for entry, (before, after) in zip(entries, pairwise(states), strict=True):
        lost = set(before.kept_attempts) - set(after.kept_attempts)
        if lost:
            ((number, _),) = lost
            assert entry["event"] in {"verdict-changed", "trial-set-aside"}
            assert entry["trial"] == number


@given(events)
def test_refused_events_change_nothing_and_no_event_raises(journal):
    state = replay(BEGIN)
    for entry in journal:
        after = apply(state, entry)
        if refusal(state, entry):
            assert after == state
        state = after


def test_a_session_is_complete_when_enough_trials_were_kept_and_it_has_ended():
    state = replay([*BEGIN, *attempt(1, "kept")])
    assert not state.is_complete
    state = replay([*BEGIN, *attempt(1, "kept"), *attempt(2, "kept")])
    assert (state.is_complete, state.phase) == (True, SessionPhase.READY)
    assert state.kept == (1, 2)
    assert apply(state, END).phase is SessionPhase.COMPLETE


def test_a_rejected_trial_is_repeated_under_its_number():
    state = replay([*BEGIN, *attempt(1, "rejected")])
    assert (state.next_trial, state.attempt(1), state.rejected) == (1, 1, 1)
    state = replay([*BEGIN, *attempt(1, "rejected"), *attempt(1, "kept")])
    assert (state.next_trial, state.attempt(1), state.kept_attempt(1)) == (2, 2, 2)


@pytest.mark.parametrize(
    "journal",
    [
        [event("trial-kept", 1)],
        [event("trial-started", 1), event("trial-recorded", 2)],
        [event("trial-started", 1), event("trial-started", 2)],
        [END, event("trial-started", 1)],
        [*attempt(1, "kept"), event("trial-started", 1)],
    ],
)
def test_impossible_events_change_nothing(journal):
    before = replay([*BEGIN, *journal[:-1]])
    assert refusal(before, journal[-1])
    assert apply(before, journal[-1]) == before


def test_a_second_start_changes_nothing():
    again = {"event": "session-started", "terrain": "B0", "trials": 9}
    assert replay([START, again]) == replay([START])


def test_an_end_in_a_running_trial_is_a_crash():
    state = replay([*BEGIN, event("trial-started", 1), event("session-ended")])
    assert (state.phase, state.running) == (SessionPhase.CRASHED, 1)


def test_a_crashed_session_is_not_resumed_before_its_trial_is_rejected():
    crashed = replay([*BEGIN, event("trial-started", 1), event("crash-found")])
    resumed = event("session-resumed")
    assert refusal(crashed, resumed) == "T01 has no verdict yet"
    state = apply(apply(crashed, event("trial-rejected", 1)), resumed)
    assert (state.phase, state.openings) == (SessionPhase.PREFLIGHT, 2)


def test_a_redo_records_one_trial_and_ends():
    whole = [*BEGIN, *attempt(1, "kept"), *attempt(2, "kept"), END]
    state = replay([*whole, event("redo-started", 1), ACTIVE])
    assert (state.next_trial, state.is_over) == (1, False)
    assert state.kept == (1, 2)  # until the new one begins
    state = apply(state, event("trial-set-aside", 1, attempt=1))
    for entry in attempt(1, "kept"):
        state = apply(state, entry)
    assert (state.is_over, state.kept_attempt(1), state.rejected) == (True, 2, 1)
    assert apply(state, END).phase is SessionPhase.COMPLETE


def test_a_redo_whose_verdict_is_undone_is_not_over():
    whole = [*BEGIN, *attempt(1, "kept"), *attempt(2, "kept"), END]
    redone = [event("trial-set-aside", 1, attempt=1), *attempt(1, "kept")]
    state = replay([*whole, event("redo-started", 1), ACTIVE, *redone])
    state = apply(state, verdict(1, 2, "reject"))
    assert (state.redoing, state.next_trial, state.is_over) == (1, 1, False)
    state = apply(state, verdict(1, 2, "keep"))
    assert (state.redoing, state.is_over) == (None, True)


def test_a_redo_of_an_unrecorded_trial_is_refused():
    state = replay([*BEGIN, *attempt(1, "kept"), END])
    assert refusal(state, event("redo-started", 2)) == "T02 was never recorded"


def test_a_verdict_change_updates_the_kept_trials_and_can_be_undone():
    state = replay([*BEGIN, *attempt(1, "kept"), *attempt(2, "kept"), END])
    state = apply(state, verdict(1, 1, "reject"))
    assert (state.kept, state.rejected, state.phase) == (
        (2,),
        1,
        SessionPhase.UNFINISHED,
    )
    state = apply(state, verdict(1, 1, "keep"))
    assert (state.kept, state.rejected, state.phase) == (
        (2, 1),
        0,
        SessionPhase.COMPLETE,
    )


@pytest.mark.parametrize("what", ["kept", "rejected"])
def test_a_repeated_verdict_changes_nothing(what):
    state = replay([*BEGIN, *attempt(1, what), *attempt(2, "kept"), END])
    again = verdict(1, 1, {"kept": "keep", "rejected": "reject"}[what])
    assert refusal(state, again) == ""
    assert apply(state, again) == state


def test_two_attempts_at_one_trial_are_never_kept_together():
    state = replay([*BEGIN, *attempt(1, "rejected"), *attempt(1, "kept"), END])
    assert refusal(state, verdict(1, 1, "keep")) == "another attempt at T01 is kept"
    assert refusal(state, verdict(1, 3, "keep")) == "there is no such attempt"


def crashed_in_the_second_attempt():
    second = [event("trial-started", 1), event("crash-found")]
    return replay([*BEGIN, *attempt(1, "rejected"), *second])


def test_a_crashed_trial_is_not_redone_before_it_has_a_verdict():
    state = crashed_in_the_second_attempt()
    assert refusal(state, event("redo-started", 1)) == "T01 has no verdict yet"


def test_an_earlier_attempt_at_a_crashed_trial_can_still_be_judged():
    state = crashed_in_the_second_attempt()
    assert refusal(state, verdict(1, 1, "keep")) == ""
    assert refusal(state, verdict(1, 2, "keep")) == "T01 has no verdict yet"


# --- drift between the tares --------------------------------------------------------


def tared(*force):
    return {"event": "tared", "bias": [*force, 0.0, 0.0, 0.0], "spread": 0.1}


def test_two_tares_bracket_the_drift_of_the_force():
    state = replay([*BEGIN, tared(0.1, 0.2, 0.3), tared(9.0, 9.0, 9.0)])
    assert state.drift == (8.9, 8.8, 8.7)
    later = replay(
        [*BEGIN, tared(0.1, 0.2, 0.3), tared(9.0, 9.0, 9.0), tared(0.0, 0.0, 0.0)]
    )
    assert later.drift == (-0.1, -0.2, -0.3)


def test_one_tare_gives_no_drift():
    assert replay([*BEGIN, tared(0.1, 0.2, 0.3)]).drift == ()


def test_equal_tares_show_no_drift():
    assert replay([*BEGIN, tared(0.1, 0.2, 0.3), tared(0.1, 0.2, 0.3)]).drift == (
        (0.0, 0.0, 0.0)
    )


def test_every_opening_of_a_session_has_its_own_pair_of_tares():
    closed = {"event": "session-ended", "reason": "unfinished"}
    events = [*BEGIN, tared(0.1, 0.2, 0.3), tared(1.0, 1.0, 1.0), closed]
    again = [*events, {"event": "session-resumed"}, ACTIVE]
    assert replay(again).drift == ()
    assert replay([*again, tared(5.0, 5.0, 5.0), tared(6.0, 6.0, 6.0)]).drift == (
        (1.0, 1.0, 1.0)
    )


@pytest.mark.parametrize(
    "bias", [None, [], [1.0] * 5, ["1"] * 6, [float("nan")] * 6, [True] * 6, "123456"]
)
def test_a_damaged_tare_changes_nothing(bias):
    sound = [*BEGIN, tared(0.1, 0.2, 0.3)]
    assert replay([*sound, {"event": "tared", "bias": bias}]) == replay(sound)


def test_a_session_without_events_is_empty():
    state = replay([])
    assert (state.wanted, state.rejected, state.openings, state.tares) == (0, 0, 0, 0)
    assert (state.kept, state.running, state.redoing, state.ended) == (
        (),
        None,
        None,
        "",
    )


@pytest.mark.parametrize("value", [0, -1, 2.5, True, "3", None])
def test_an_invalid_number_of_trials_counts_as_zero(value):
    started = {"event": "session-started", "terrain": "TF", "trials": value}
    assert replay([started]).wanted == 0


@pytest.mark.parametrize("verdict", ["", "maybe", None, 1])
def test_a_verdict_that_is_neither_keep_nor_reject_is_refused(verdict):
    fields = {"trial": 1, "attempt": 1}
    events = [
        {"event": "session-started", "terrain": "TF", "trials": 1},
        {"event": "activated"},
        {"event": "trial-started", **fields},
        {"event": "trial-recorded", **fields},
        {"event": "trial-kept", **fields},
        {"event": "session-ended", "reason": "complete"},
    ]
    changed = {"event": "verdict-changed", **fields, "verdict": verdict}
    assert refusal(replay(events), changed) == "a verdict is keep or reject"
    assert refusal(replay(events), {**changed, "verdict": "reject"}) == ""


def test_a_drift_is_rounded_to_a_millinewton():
    state = replace(
        replay([]), tares=2, first_bias=(0.0,) * 6, last_bias=(0.12345,) * 6
    )
    assert state.drift == (0.123, 0.123, 0.123)
    assert replace(state, tares=1).drift == ()


@pytest.mark.parametrize(
    ("reason", "ended"),
    [
        ("complete", "complete"),
        ("quit", "quit"),
        ("", "unfinished"),
        (None, "unfinished"),
    ],
)
def test_a_session_ends_with_the_recorded_reason(reason, ended):
    end = {"event": Event.ENDED, "reason": reason}
    assert replay([*BEGIN, end]).ended == ended
