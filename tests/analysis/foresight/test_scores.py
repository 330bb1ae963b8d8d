from dataclasses import replace

import numpy as np
import pytest

from analysis.foresight.calibration import calibration_error
from analysis.foresight.engine import ForesightFlag, ForesightState
from analysis.foresight.held_out import folds_of, hold_out
from analysis.foresight.scores import ground_answers, score_ground, score_slips
from analysis.foresight.ticks import ForesightRun
from tests.analysis.foresight.made import STONES, model, trial, trials

THRESHOLD = 0.5


def run(warned_from, warned_to, onsets):
    """Return a run of 4 s with one alarm, and slips of 0.1 s."""
    push = trial(STONES, 0)
    t = push.t[0] + 0.01 * np.arange(400)
    onsets = push.t[0] + np.array(onsets)
    made = replace(
        push,
        t=t,
        tick=np.arange(400),
        onsets=onsets,
        ends=onsets + 0.1,
        features=push.features[:400],
        motion=np.tile([0.0, 3.0, 4.0], (400, 1)),
    )
    is_on = (t - t[0] >= warned_from) & (t - t[0] < warned_to)
    states = tuple(
        ForesightState(
            *(5 * k, 0, 0, int(ForesightFlag.ALARM) if on else 0),
            *(0.9 if on else 0.1, 0.0, 0.0, 0.0, 3.0, 4.0, 0.0, (1.0,)),
        )
        for k, on in enumerate(is_on)
    )
    return ForesightRun(made, states, THRESHOLD, (STONES,), ("rocky",))


def test_an_alarm_before_a_slip_has_its_lead():
    score = score_slips([run(1.85, 2.0, [2.0])])
    assert (score.recall, score.early, score.per_minute) == (1.0, 1.0, 0.0)
    assert score.lead == pytest.approx(0.15, abs=0.011)


def test_an_alarm_that_is_over_before_is_false_and_its_slip_missed():
    score = score_slips([run(1.0, 1.2, [2.0])])
    assert score.recall == 0.0
    assert score.false_share == 1.0
    assert score.per_minute == pytest.approx(60.0 / 3.99, rel=0.01)


def test_an_alarm_that_never_ends_has_no_long_lead_and_costs_all_the_time():
    score = score_slips([run(0.0, 4.0, [3.5])])
    assert score.lead == 2.0
    assert score.needless == 1.0
    assert score.chance == 1.0


def test_an_alarm_within_a_slip_is_late_and_not_false():
    score = score_slips([run(2.02, 2.06, [2.0])])
    assert (score.recall, score.per_minute) == (0.0, 0.0)


def test_needless_time_leaves_out_what_is_before_slips():
    assert score_slips([run(1.8, 2.0, [2.0])]).needless == pytest.approx(0.0, abs=0.004)


def test_short_warnings_rarely_hit_by_chance():
    assert score_slips([run(1.9, 2.0, [2.0])]).chance < 0.3


def test_probabilities_that_come_true_are_calibrated():
    random = np.random.default_rng(0)
    p = random.random(20_000)
    assert calibration_error(p, random.random(p.size) < p) < 0.015
    assert calibration_error(p, random.random(p.size) < 0.5 * p) > 0.2


def test_no_trial_is_foreseen_by_what_it_taught():
    parts = folds_of(trials(0, 5))
    tested = [t.name for test, _ in parts for t in test]
    assert sorted(tested) == sorted(t.name for t in trials(0, 5))
    for test, rest in parts:
        assert not {t.name for t in test} & {t.name for t in rest}


@pytest.mark.slow
def test_held_out_pushes_are_foreseen_too():
    runs = hold_out(trials(0, 3), {})
    assert len(runs) == 6
    assert score_slips([r for r in runs if r.trial.surface == "rocky"]).recall > 0.85


def test_stones_and_plates_are_told_apart_and_changes_seen():
    score = score_ground([ground_answers(model().ground, trials(80, 3))])
    assert min(score.accuracy) == 1.0
    assert min(score.anywhere) > 0.97
    assert score.back <= 1.0  # s of sliding


def test_one_surface_cannot_be_told_apart():
    one = replace(model().ground, surfaces=())
    assert score_ground([ground_answers(one, trials(80, 1))]) is None
