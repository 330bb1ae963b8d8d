from dataclasses import replace

import numpy as np
import pytest

from analysis.foresight.ground import SHARES, GroundLaw, GroundModel, GroundRecogniser
from analysis.foresight.ground_window import GROUND_FEATURES, GroundWindow
from tests.analysis.foresight.made import PLATE, STONES, model, trial


def law(name, force, surface="rocky"):
    """Return a law of F_t = force, give or take 1 N."""
    return GroundLaw(
        name,
        surface,
        (force, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (1.0, 8.0),
        (-3.0, -1.5, -1.2, -0.5, -0.1, -0.05, -0.01),
    )


TWO = GroundModel((law("low", 3.0), law("high", 9.0)), ())


def slid(recogniser, force, ticks, first=0, sd=0.7):
    random = np.random.default_rng(first)
    for tick in range(first, first + ticks):
        recogniser.push(tick, 0.05, force + sd * random.normal(), 4.0)
    return recogniser


def test_the_terrain_whose_force_is_met_becomes_the_likeliest():
    shares, none = slid(GroundRecogniser(TWO), 9.0, 100).probabilities()
    assert shares[1] > 0.98
    assert none == 0.0


def test_nothing_is_known_before_the_foot_slides():
    recogniser = GroundRecogniser(TWO)
    assert not recogniser.is_informed
    assert recogniser.probabilities()[0] == [0.5, 0.5]


def test_probabilities_and_none_sum_to_one():
    shares, none = slid(GroundRecogniser(TWO), 14.0, 100).probabilities()
    assert sum(shares) + none == pytest.approx(1.0)


def test_a_force_that_no_terrain_has_is_none_of_them():
    assert slid(GroundRecogniser(TWO), 20.0, 100).probabilities()[1] == 1.0


def test_forces_that_never_vary_are_none_of_them_either():
    never = slid(GroundRecogniser(TWO), 9.0, 100, sd=0.0)
    assert never.probabilities()[1] == 1.0


def test_bounded_odds_turn_round_within_a_second_however_long_they_were_right():
    recogniser = slid(GroundRecogniser(TWO), 3.0, 3000)
    assert slid(recogniser, 9.0, 100, first=3000).probabilities()[0][1] > 0.95


def test_a_lifted_foot_knows_nothing_any_more():
    recogniser = slid(GroundRecogniser(TWO), 9.0, 100)
    recogniser.reset()
    assert recogniser.probabilities()[0] == [0.5, 0.5]
    assert recogniser.window.slid == 0


def test_lost_samples_leave_how_long_the_foot_has_slid():
    recogniser = slid(GroundRecogniser(TWO), 9.0, 100)
    recogniser.forget()
    assert recogniser.probabilities()[0] == [0.5, 0.5]
    assert recogniser.window.slid == 100


@pytest.mark.parametrize("size", [25, 50, 100])
def test_running_sums_are_what_the_window_holds(size):
    random = np.random.default_rng(5)
    window = GroundWindow()
    F_n = 4.0 + random.normal(size=700)
    F_t = 2.0 * F_n + random.normal(size=700)
    for tick in range(700):
        window.push(tick, 0.05, float(F_t[tick]), float(F_n[tick]))
    features = dict(zip(GROUND_FEATURES, window.features(size), strict=True))
    assert features["log mean of F_t"] == pytest.approx(np.log(F_t[-size:].mean()))
    assert features["log sd of F_t"] == pytest.approx(np.log(F_t[-size:].std()))
    slope = np.cov(F_n[-size:], F_t[-size:], bias=True)[0, 1]
    slope /= F_n[-size:].var() + 0.05
    assert features["slope of F_t on F_n"] == pytest.approx(slope)
    assert features["log time taken"] == 0.0


@pytest.mark.parametrize(("terrain", "is_rocky"), [(STONES, True), (PLATE, False)])
def test_surfaces_are_told_apart_on_a_push_that_was_not_seen(terrain, is_rocky):
    push = trial(terrain, 77)
    recogniser = GroundRecogniser(model().ground)
    for row in push.sliding[:100]:
        v, F_t, F_n = push.motion[row].tolist()
        recogniser.push(int(push.tick[row]), v, F_t, F_n)
    assert (recogniser.rocky > 0.5) is is_rocky


def test_loads_outside_what_was_recorded_are_taken_at_the_edge():
    one = replace(law("low", 3.0), mean=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    assert one.at(100.0, 0.05)[0] == one.at(8.0, 0.05)[0] == 8.0


def test_doubt_grows_towards_both_ends_of_its_own_windows():
    points = dict(zip(SHARES, law("low", 3.0).densities, strict=True))
    doubts = [law("low", 3.0).doubt(points[share]) for share in (0.5, 0.02, 0.01)]
    assert doubts == pytest.approx([0.0, 0.0, 0.5])
    assert law("low", 3.0).doubt(-10.0) == law("low", 3.0).doubt(0.0) == 1.0
