import json

import numpy as np
import pytest

from acquisition.validation import first_problem
from analysis.foresight.held_out import foresee
from analysis.foresight.model import ForesightModel
from analysis.foresight.scores import score_slips
from analysis.foresight.training import fit_foresight, fit_laws
from tests.analysis.foresight.made import (
    OTHER_RIG,
    PLATE,
    RIG,
    STONES,
    model,
    trial,
    trials,
)


def test_a_tick_at_risk_is_in_contact_and_in_no_slip():
    push = trial(STONES, 0)
    for onset, end in zip(push.onsets, push.ends, strict=True):
        assert not push.is_at_risk[(push.t >= onset) & (push.t <= end)].any()
    assert push.is_at_risk.any()


def test_what_is_before_a_slip_is_the_fifth_of_a_second_before_it():
    push = trial(STONES, 0)
    for t in push.t[push.is_before_slip]:
        assert any(0.0 < onset - t <= 0.2 + 1e-6 for onset in push.onsets)
    assert push.is_before_slip.sum() == pytest.approx(20 * push.onsets.size, abs=30)


def test_the_same_trials_teach_the_same_bits():
    assert fit_foresight(trials(0, 5)) == model()


def test_slips_of_pushes_that_were_not_seen_are_foreseen():
    score = score_slips(foresee(model(), [trial(STONES, k) for k in range(90, 93)], {}))
    assert score.onsets > 20
    assert score.recall > 0.9
    assert score.lead > 0.1
    assert score.recall > score.chance + 0.15
    assert score.calibration < 0.05


def test_the_threshold_leaves_so_much_of_the_time_in_needless_warning():
    score = score_slips(foresee(model(), [trial(STONES, k) for k in range(5)], {}))
    assert score.needless == pytest.approx(0.08, abs=0.03)


def test_a_plate_without_slips_is_hardly_ever_warned_of():
    score = score_slips(foresee(model(), [trial(PLATE, k) for k in range(90, 93)], {}))
    assert score.onsets == 0
    assert score.needless < 0.01


def test_few_slips_teach_the_ground_and_no_probability():
    learnt = fit_foresight([trial(PLATE, k) for k in range(3)])
    assert learnt.slip is None
    assert learnt.terrains == (PLATE,)


def test_a_law_is_the_force_of_the_plate():
    (law,) = fit_laws([trial(PLATE, k) for k in range(5)])
    mean, log_sd = law.at(4.0, 0.05)
    assert mean == pytest.approx(3.0 + 8.0 * 0.05, abs=0.05)
    assert np.exp(log_sd) < 0.3


def test_what_it_was_learnt_from_stands_beside_it():
    source = model().provenance
    assert source.rigs == (RIG,)
    assert source.trials[0] == f"{STONES}/0"
    assert model().knows(RIG)
    assert not model().knows(OTHER_RIG)


def test_a_model_survives_its_text_bit_for_bit():
    text = json.dumps(model().to_dict())
    assert ForesightModel.from_dict(json.loads(text)) == model()


def broken():
    plain = json.loads(json.dumps(model().to_dict()))
    laws, slip, source = plain["laws"], plain["slip"], plain["provenance"]
    return [
        ({"version": 2}, "version: Input should be 1"),
        ({"features": ["x"]}, "features: foresight was trained on other features"),
        ({"laws": []}, "laws: Tuple should have at least 1 item"),
        ({"laws": laws * 9}, "laws: Tuple should have at most 16 items"),
        ({"laws": [laws[0] | {"mean": [1.0]}]}, "laws.0.mean.1 is missing"),
        (
            {"laws": [laws[0] | {"loads": [5.0, 1.0]}]},
            "laws.0.loads: the values do not increase",
        ),
        ({"laws": [laws[0] | {"name": "\x1b[2J"}]}, "laws.0.name: it is not printable"),
        (
            {"laws": [laws[0] | {"log_sd": [1e5, 0.0, 0.0]}]},
            "laws.0.log_sd.0: Input should be less than or equal to 100",
        ),
        (
            {"slip": slip | {"threshold": 1.5}},
            "slip.threshold: Input should be less than 1",
        ),
        ({"slip": slip | {"reach": [1.0]}}, "slip.reach.1 is missing"),
        (
            {"surfaces": {"7": next(iter(plain["surfaces"].values()))}},
            "surfaces: foresight has other windows",
        ),
        (
            {"provenance": source | {"trials": ["x"] * 5001}},
            "provenance.trials: Tuple should have at most 5000 items",
        ),
    ]


@pytest.mark.parametrize(("change", "words"), broken(), ids=lambda part: str(part)[:20])
def test_a_model_that_cannot_be_is_refused(change, words):
    with pytest.raises(ValueError, match=r".+") as caught:
        ForesightModel.from_dict(model().to_dict() | change)
    assert first_problem(caught.value).startswith(words)
