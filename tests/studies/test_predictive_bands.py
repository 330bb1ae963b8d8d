"""Predictive bands on trials left out: a slice of a study, and by hand a whole one."""

from pathlib import Path

import pytest

from analysis.data.tables import load_tables
from studies.predictive_bands import (
    BANDS,
    LEAST_HITS,
    NEW,
    SAME_TOP,
    evaluate,
    mean,
    of_kind,
    shortfalls,
    table,
)


@pytest.fixture(scope="module")
def slice_outcomes():
    path = Path(__file__).parents[1] / "data" / "rehearsal_slice.npz"
    trials = {name: list(series) for name, series in load_tables([path]).items()}
    return trials, evaluate(trials, 1, 3)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_every_trial_of_a_slice_is_left_out_once(slice_outcomes):
    trials, outcomes = slice_outcomes
    assert [o.terrain for o in outcomes] == ["S0"] * 3 + ["B0"] * 3 + ["TF"] * 3
    lines = table("stones", of_kind(outcomes, trials, plates=False))
    assert lines[0] == "stones: 6 trials"


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_bands_on_a_slice_hold_about_their_share(slice_outcomes):
    _, outcomes = slice_outcomes
    # two training trials know little of the spread between trials: bands may be wide
    for key, nominal in BANDS:
        assert mean(outcomes, NEW, key) == pytest.approx(nominal, abs=0.15)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_fits_of_a_slice_end_at_the_best_of_more_starts(slice_outcomes):
    assert all(outcome.missed < SAME_TOP for outcome in slice_outcomes[1])


@pytest.mark.long
@pytest.mark.shared_data
@pytest.mark.timeout(3600)
def test_bands_of_a_whole_study_hold(shared_data):
    trials = load_tables([shared_data / "rehearsal_trials.npz"])
    series = {name: list(group) for name, group in trials.items()}
    outcomes = evaluate(series, 2, 20)
    stones, plates = (of_kind(outcomes, series, plates=p) for p in (False, True))
    assert shortfalls(stones, plates) == []
    hits = sum(outcome.missed < SAME_TOP for outcome in outcomes)
    assert hits >= LEAST_HITS * len(outcomes)
