"""Stances judged, the risk adapted, all summed up."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.stance.interface import StanceRequest
from analysis.stance.outcomes import StanceOutcome, StanceWatch, adapted, totals, wilson

REQUEST = StanceRequest(6.0, 0.1)
TICK = 0.02


def stance(speed: float, force: float = 6.0, seconds: float = 1.0) -> StanceOutcome:
    watch = StanceWatch(spot=0.1, risk=0.1, scale=1.0, x0=0.1)
    for k in range(round(seconds / TICK)):
        watch.push(TICK, 0.1 + speed * TICK * (k + 1), speed, force, 5.0)
    return watch.outcome(REQUEST)


def test_a_foot_that_stays_has_succeeded():
    held = stance(0.002)

    assert held.is_success
    assert not held.is_slip
    assert held.delivered == pytest.approx(6.0)
    assert held.slid == 0.0


def test_ten_millimetres_are_a_slip_and_only_the_rest_was_slid():
    slipped = stance(0.02)

    assert slipped.is_slip
    assert not slipped.is_success
    assert slipped.slid == pytest.approx(0.02 - 0.0104, abs=1e-4)


def test_speed_alone_is_a_slip():
    assert stance(0.061, seconds=0.1).is_slip
    assert not stance(0.059, seconds=0.1).is_slip


def test_ground_that_gives_is_no_slip_but_teaches_that_it_gave():
    gave, held = stance(0.04, seconds=0.1), stance(0.002)

    assert gave.is_giving
    assert not gave.is_slip
    assert gave.push is not None
    assert held.push is not None
    assert (gave.push.is_held, held.push.is_held) == (False, True)


def test_a_record_of_earlier_stances_knows_of_slips_alone():
    told = stance(0.03).to_dict()
    del told["is_giving"], told["borne"]

    assert StanceOutcome.from_dict(told) == stance(0.03)


def test_ground_that_gave_teaches_of_the_load_it_had_until_then():
    watch = StanceWatch(spot=0.1, risk=0.1, scale=1.0, x0=0.1)
    for k in range(50):
        v_t, F_n = (0.001, 5.0) if k < 20 else (0.04, 5.0) if k < 22 else (0.001, 15.0)
        watch.push(TICK, 0.1, v_t, 3.0, F_n)
    gave = watch.outcome(REQUEST)

    assert gave.push is not None
    assert gave.push.F_n == pytest.approx(5.0)
    assert gave.load > 10.0


def test_too_little_impulse_is_no_success():
    assert not stance(0.0, force=3.0).is_success


def test_a_slip_lowers_the_scale_and_a_stance_that_held_raises_it():
    held, slipped = stance(0.002), stance(0.03)

    assert adapted(1.0, slipped) < 1.0 < adapted(1.0, held)
    assert adapted(1.0, slipped) == pytest.approx(np.exp(0.15 * (0.1 - 1.0)))


def test_nothing_is_adapted_where_nothing_was_foreseen():
    assert adapted(0.8, replace(stance(0.03), risk=float("nan"))) == 0.8


def test_adaptation_reaches_the_asked_share_on_ground_that_was_misjudged():
    rng = np.random.default_rng(4)
    scale, slips = 3.0, []
    held, slipped = stance(0.0), stance(0.03)
    for _ in range(600):
        is_slip = bool(rng.lognormal(0.0, 0.5) < 0.53 * scale)  # .1 where scale is 1
        slips.append(is_slip)
        scale = adapted(scale, slipped if is_slip else held)

    assert np.mean(slips[80:]) == pytest.approx(0.1, abs=0.03)


def test_outcomes_come_back_from_json():
    outcome = replace(stance(0.002), risk=float("nan"))
    again = StanceOutcome.from_dict(outcome.to_dict())

    assert outcome.to_dict()["risk"] is None
    assert again.to_dict() == outcome.to_dict()


def test_a_stance_teaches_what_it_bore_and_whether_it_held():
    held, slipped = stance(0.002).push, stance(0.03).push

    assert held is not None
    assert slipped is not None
    assert (held.is_held, slipped.is_held) == (True, False)
    assert stance(0.0, force=0.1).push is None


def test_sums_of_nothing_are_none_and_of_stances_shares():
    summed = totals([stance(0.0), stance(0.03)], REQUEST)

    assert totals([], REQUEST) is None
    assert summed is not None
    assert (summed.slips, summed.successes, summed.count) == (0.5, 0.5, 2)


def test_the_interval_is_that_of_the_textbook():
    assert wilson(0.1, 100) == pytest.approx((0.0552, 0.1744), abs=1e-4)
