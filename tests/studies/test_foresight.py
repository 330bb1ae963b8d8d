"""The proof of foresight: its limits, a short form, and by hand whole studies."""

from pathlib import Path

import pytest

from analysis.foresight.held_out import foresee
from studies.foresight import (
    THEIR_RIG,
    Judge,
    contour_alarms,
    cost,
    report,
    report_ground,
)
from tests.analysis.foresight.made import STONES, model, trial, trials


def test_a_limit_that_is_missed_is_named_and_one_that_is_met_is_not():
    judge = Judge()
    judge.at_least("recall", 0.80, 0.80)
    judge.at_most("needless", 0.10, 0.10)
    assert judge.missed == []
    judge.at_least("recall", 0.79, 0.80)
    judge.at_most("needless", 0.11, 0.10)
    assert [text.split()[0] for text in judge.missed] == ["recall", "needless"]


def test_what_is_not_known_meets_no_limit():
    judge = Judge()
    judge.at_least("lead", float("nan"), 0.1)
    judge.at_most("back", float("nan"), 1.0)
    assert len(judge.missed) == 2


@pytest.mark.slow
def test_made_pushes_are_foreseen_within_every_limit(capsys):
    judge, unseen = Judge(), [trial(STONES, k) for k in range(90, 93)]
    report("made", foresee(model(), unseen, {}), judge)
    report_ground({"made": model()}, {"made": trials(80, 3)}, judge)
    assert judge.missed == []
    assert "recall" in capsys.readouterr().out


def test_the_cost_is_that_of_every_sample():
    assert 0.0 < cost(model(), [trial(STONES, 90)]) < 1.0


@pytest.mark.long
@pytest.mark.shared_data
@pytest.mark.timeout(3600)
def test_contour_trials_give_less_than_an_alarm_a_minute(shared_data):
    folder = Path(shared_data) / "real" / "kuleuven_contour"
    alarms, minutes = contour_alarms(model(), folder, THEIR_RIG)
    assert minutes > 1.0
    assert alarms <= 1.0
