import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.breakaway.censored import Family
from analysis.breakaway.model import BREAK_AWAY, BreakAwayModel, PushLaw
from analysis.foresight.engine import (
    EVERY,
    FootSample,
    Foresight,
    ForesightFlag,
    RiskTable,
)
from tests.analysis.foresight.made import OTHER_RIG, PLATE, RIG, STONES, model, trial

BREAKS = BreakAwayModel(
    kind=BREAK_AWAY,
    family=Family.LOGNORMAL,
    law=PushLaw(math.log(8.0), 0.2, 0.3, 0.1),
    draws=np.array([[math.log(8.0), 0.2, 0.3, 0.1]]),
    v_slip=0.12,
    slips=50,
    held=5,
    trials=10,
    loads=(1.0, 8.0),
    forces=(2.0, 12.0),
)


def foresight(rig=RIG, known=None):
    return Foresight(model(), {} if known is None else known, rig)


def states(samples, watch=None):
    watch = watch or foresight()
    return [state for s in samples if (state := watch.push(s)) is not None]


def numbers(state):
    """Return a state's values so that NaN equals NaN."""
    return np.array(
        [
            *(state.flags, state.since, state.slip_probability, state.traction),
            *(state.break_away_risk, state.v_t, state.F_t, state.F_n, state.none),
            *state.terrains,
        ]
    ).tobytes()


def still(count, first=0, F_t=3.0, F_n=4.0):
    return [
        FootSample(c, c * 2_000_000, 0.0, F_t, F_n) for c in range(first, first + count)
    ]


def test_a_state_comes_every_ten_milliseconds():
    cycles = [state.cycle for state in states(still(50, first=3))]
    assert cycles == list(range(5, 53, EVERY))


def test_the_same_samples_give_the_same_bits():
    samples = trial(STONES, 50).samples
    first, again = (list(map(numbers, states(samples))) for _ in range(2))
    assert first == again


def test_a_trial_begun_anew_is_the_first_trial():
    samples, watch = trial(STONES, 50).samples, foresight()
    first = list(map(numbers, states(samples, watch)))
    watch.reset()
    assert list(map(numbers, states(samples, watch))) == first


def test_nothing_depends_on_samples_that_follow():
    samples = trial(STONES, 50).samples
    short, whole = states(samples[:2000]), states(samples)
    assert list(map(numbers, short)) == list(map(numbers, whole[: len(short)]))


def test_nothing_is_said_before_the_filters_are_warm():
    seen = states(still(200))
    is_valid = [bool(s.flags & ForesightFlag.VALID) for s in seen]
    assert is_valid == [state.cycle >= 100 for state in seen]
    assert math.isnan(seen[0].slip_probability)


def test_a_missing_cycle_lets_the_filters_begin_anew():
    samples = still(300)
    seen = states([*samples[:150], *samples[151:]])
    assert {s.since for s in seen if s.cycle > 150} == {151}
    assert not [s for s in seen if 150 < s.cycle < 251 and s.flags & 1]


@pytest.mark.parametrize(("lost", "is_known"), [(10, True), (200, False)])
def test_a_short_gap_leaves_the_ground_and_a_long_one_does_not(lost, is_known):
    samples = trial(PLATE, 50).samples
    watch = foresight()
    states(samples[:2000], watch)
    states(samples[2000 + lost : 2001 + lost], watch)
    assert watch.ground.is_informed is is_known


def test_a_lifted_foot_forgets_the_ground():
    watch = foresight()
    states(trial(PLATE, 50).samples[:2000], watch)
    states(still(100, first=2000, F_n=0.0), watch)
    assert not watch.ground.is_informed


def test_a_foot_in_the_air_has_no_probability_of_a_slip():
    state = states(still(300, F_n=0.0))[-1]
    assert not state.flags & (ForesightFlag.CONTACT | ForesightFlag.VALID)
    assert math.isnan(state.slip_probability)


def test_another_rig_is_said_and_nothing_guessed():
    seen = states(trial(STONES, 50).samples, foresight(OTHER_RIG))
    assert all(state.flags & ForesightFlag.OTHER_RIG for state in seen)
    guesses = [(s.slip_probability, s.traction, *s.terrains) for s in seen]
    assert np.isnan(np.array(guesses)).all()
    assert not any(state.flags & ForesightFlag.ALARM for state in seen)


def test_a_slip_that_runs_is_a_state_of_its_own():
    seen = states(trial(STONES, 50).samples)
    slipping = [s for s in seen if s.flags & ForesightFlag.SLIPPING]
    assert slipping
    assert all(math.isnan(state.slip_probability) for state in slipping)


def test_samples_without_a_force_are_passed_over():
    samples = still(300)
    samples[150] = replace(samples[150], F_t=math.nan)
    seen = states(samples)
    assert {s.since for s in seen if s.cycle > 150} == {151}


def test_an_alarm_goes_on_until_it_is_calm_for_fifty_milliseconds():
    seen = states(trial(STONES, 50).samples)
    threshold = model().slip.threshold
    alarms = [bool(s.flags & ForesightFlag.ALARM) for s in seen]
    p = [s.slip_probability for s in seen]
    begins = [k for k in range(1, len(seen)) if alarms[k] and not alarms[k - 1]]
    ends = [k for k in range(1, len(seen)) if alarms[k - 1] and not alarms[k]]
    assert begins
    assert all(p[k] >= threshold for k in begins)
    for k in ends:
        last = p[k - 4 : k + 1]
        assert math.isnan(p[k]) or max(last) < 0.7 * threshold


def test_the_risk_is_that_of_the_terrains_by_their_probability():
    known = {STONES: BREAKS, PLATE: BREAKS}
    state = states(still(200, F_t=6.0), foresight(known=known))[-1]
    wanted = BREAKS.slip_risk(state.F_t, state.F_n).risk
    assert state.break_away_risk == pytest.approx(wanted, abs=0.005)
    assert not state.flags & ForesightFlag.EXTRAPOLATED


def test_a_push_beyond_all_that_were_recorded_is_marked():
    known = {STONES: BREAKS, PLATE: BREAKS}
    state = states(still(200, F_t=20.0), foresight(known=known))[-1]
    assert state.flags & ForesightFlag.EXTRAPOLATED


@pytest.mark.parametrize("change", [{"F_n": 30.0}, {"F_t": 40.0}])
def test_loads_that_nothing_was_learnt_at_have_no_probability(change):
    state = states(still(200, **change))[-1]
    assert state.flags & ForesightFlag.BEYOND
    assert math.isnan(state.slip_probability)
    assert not states(still(200))[-1].flags & ForesightFlag.BEYOND


def test_without_break_away_models_the_risk_is_not_known():
    assert math.isnan(states(still(200))[-1].break_away_risk)


def test_the_table_of_risks_is_the_model_within_half_a_percent():
    random = np.random.default_rng(4)
    F_t, F_n = random.uniform(0.0, 30.0, 500), random.uniform(0.5, 20.0, 500)
    table = RiskTable(BREAKS)
    own = [table.at(*point) for point in zip(F_t, F_n, strict=True)]
    assert np.abs(np.array(own) - BREAKS.risks(F_t, F_n)).max() < 0.005


def test_traction_is_what_the_ground_gives_while_it_slides():
    seen = states(trial(PLATE, 60).samples)
    sliding = [s for s in seen if s.flags & ForesightFlag.GROUND]
    known = [state for state in sliding if state.none < 1.0]
    assert len(known) > 0.95 * len(sliding)
    off = [abs(state.traction - state.F_t) for state in known]
    assert np.median(off) < 0.3  # N, the noise that was made
