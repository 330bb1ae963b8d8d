"""What the four policies answer, and that they are pure."""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.breakaway.censored import Family
from analysis.breakaway.model import BREAK_AWAY, BreakAwayModel, PushLaw
from analysis.stance.interface import (
    BEGIN,
    StanceCommand,
    StanceForesight,
    StancePhase,
    StanceRequest,
    StanceSample,
    risk_tables,
)
from analysis.stance.policies import (
    POLICIES,
    avoid_slip,
    constant_mu,
    no_policy,
    oracle,
    planned,
)

REQUEST = StanceRequest(6.0, 0.1)
REST = StanceSample(0.0, False, 0.0, 0.0, 0.0, 0.0, 0.0, BEGIN)


def model(median: float, slope: float, spread: float) -> BreakAwayModel:
    """Return a law whose median at 3.5 N is `median`."""
    law = PushLaw(math.log(median), slope, spread, 0.01)
    return BreakAwayModel(
        kind=BREAK_AWAY,
        family=Family.LOGNORMAL,
        law=law,
        draws=np.array([law.values]),
        v_slip=0.06,
        slips=20,
        held=20,
        trials=10,
        loads=(3.0, 20.0),
        forces=(1.0, 12.0),
    )


TABLES = risk_tables({"stones": model(8.0, 0.1, 0.5), "plate": model(1.2, 1.0, 0.05)})
ON_STONES = StanceForesight({"stones": 1.0, "plate": 0.0}, TABLES)
ON_PLATE = StanceForesight({"stones": 0.0, "plate": 1.0}, TABLES)


def test_load_is_bought_where_it_helps():
    load, most = planned(ON_PLATE, REQUEST)

    assert most == REQUEST.peak
    assert ON_PLATE.risk(most, load) <= 0.05 < ON_PLATE.risk(most, load - 0.5)


def test_where_load_does_not_help_the_traction_is_what_the_risk_allows():
    load, most = planned(ON_STONES, REQUEST)

    assert most < REQUEST.peak
    assert load < 6.0  # four times that would bring a seventh more
    assert ON_STONES.risk(most, load) == pytest.approx(REQUEST.risk, abs=1e-3)


def test_risk_is_not_a_ratio_of_the_forces():
    light, heavy = ON_STONES.risk(6.0, 4.0), ON_STONES.risk(12.0, 8.0)

    assert heavy > light + 0.2


def test_a_larger_scale_takes_more_and_a_smaller_one_less():
    taken = [planned(replace(ON_STONES, scale=s), REQUEST)[1] for s in (0.5, 1.0, 1.2)]

    assert taken == sorted(taken)
    assert taken[0] == pytest.approx(0.5 * taken[1], rel=0.03)


def test_a_larger_scale_never_lightens_the_load():
    known = planned(ON_PLATE, REQUEST)

    assert planned(replace(ON_PLATE, scale=3.0), REQUEST) == known
    assert known[1] == REQUEST.peak


def test_uncertain_ground_lies_between_the_grounds():
    mixed = StanceForesight({"stones": 0.5, "plate": 0.5}, TABLES)
    ends = ON_STONES.risk(5.0, 10.0), ON_PLATE.risk(5.0, 10.0)

    assert mixed.risk(5.0, 10.0) == pytest.approx(sum(ends) / 2.0)


@pytest.mark.parametrize("name", POLICIES)
def test_policies_are_pure(name):
    sample = replace(REST, t=0.2, is_loaded=True, F_n=6.0, impulse=0.4)
    foresight = replace(ON_STONES, capacity=7.0)

    answers = {POLICIES[name](sample, foresight, REQUEST) for _ in range(3)}

    assert len(answers) == 1


@pytest.mark.parametrize(
    ("policy", "load"), [(no_policy, 4.0), (constant_mu, 12.0), (oracle, 20.0)]
)
def test_what_is_pressed_with_before_anything_is_asked(policy, load):
    command = policy(REST, replace(ON_STONES, capacity=7.0), REQUEST)

    assert (command.F_t, command.F_n) == (0.0, load)
    assert command.phase is StancePhase.LOAD


def pushing(most: float, **at: float) -> StanceSample:
    last = StanceCommand(most, 5.0, StancePhase.PUSH, since=0.0, most=most)
    return replace(REST, is_loaded=True, last=last, **at)


@pytest.mark.parametrize(("x", "v_t"), [(0.011, 0.0), (0.0, 0.061)])
def test_a_foot_that_slips_is_let_go_and_tried_with_less(x, v_t):
    command = avoid_slip(pushing(4.0, t=0.5, x=x, v_t=v_t), ON_STONES, REQUEST)

    assert command.phase is StancePhase.BACK_OFF
    assert command.F_t == 0.0
    assert command.most == pytest.approx(3.2)


@pytest.mark.parametrize(("x", "v_t"), [(0.009, 0.0), (0.0, 0.059)])
def test_a_foot_that_creeps_is_not_let_go(x, v_t):
    command = avoid_slip(pushing(4.0, t=0.5, x=x, v_t=v_t), ON_STONES, REQUEST)

    assert command.phase is not StancePhase.BACK_OFF
    assert command.F_t >= 3.6


@pytest.mark.parametrize(("x", "v_t"), [(0.007, 0.01), (0.001, 0.04)])
def test_a_foot_under_which_the_ground_begins_to_give_is_eased_and_pressed(x, v_t):
    command = avoid_slip(pushing(5.0, t=0.5, x=x, v_t=v_t), ON_STONES, REQUEST)

    assert command.phase is StancePhase.EASED
    assert command.F_t == command.most == pytest.approx(4.5)
    assert command.F_n == pytest.approx(5.5)


def test_a_foot_is_pressed_with_twenty_newtons_at_most():
    sample = pushing(5.0, t=0.5, x=0.007, v_t=0.01)
    heavy = replace(sample, last=replace(sample.last, F_n=19.5))

    assert avoid_slip(heavy, ON_STONES, REQUEST).F_n == 20.0


def resting(eased: StanceCommand, t: float) -> StanceSample:
    return replace(REST, t=t, is_loaded=True, x=0.007, v_t=0.001, last=eased)


def test_an_eased_foot_that_would_be_late_takes_more_slowly_and_keeps_its_load():
    # 4.2 N s are left, and 1 N for 2.5 s would bring 2.5 of them
    eased = StanceCommand(1.0, 5.5, StancePhase.EASED, since=0.0, most=1.0)
    command = eased
    for k in range(25):  # half a second
        command = avoid_slip(resting(command, 0.5 + 0.02 * k), ON_STONES, REQUEST)

    assert command.phase is StancePhase.EASED
    assert command.F_t == pytest.approx(eased.F_t + 0.5)
    assert command.F_n == eased.F_n


def test_an_eased_foot_that_will_be_done_in_time_takes_no_more():
    eased = StanceCommand(2.0, 5.5, StancePhase.EASED, since=0.0, most=2.0)

    assert avoid_slip(resting(eased, 0.5), ON_STONES, REQUEST).F_t == 2.0


def test_an_eased_foot_never_takes_more_than_the_peak():
    eased = StanceCommand(5.99, 5.5, StancePhase.EASED, since=0.0, most=5.99)

    assert avoid_slip(resting(eased, 2.9), ON_STONES, REQUEST).F_t == REQUEST.peak


def test_an_eased_foot_is_eased_again_where_the_ground_gives_again():
    eased = StanceCommand(4.0, 5.5, StancePhase.EASED, since=0.0, most=4.0)
    sample = replace(resting(eased, 1.0), v_t=0.01)

    assert avoid_slip(sample, ON_STONES, REQUEST).F_t == pytest.approx(3.6)


def test_a_foot_that_slipped_pushes_again_once_it_rests():
    last = StanceCommand(0.0, 5.0, StancePhase.BACK_OFF, since=0.6, most=3.2)
    moving = replace(REST, t=0.7, is_loaded=True, v_t=0.02, last=last)
    resting = replace(moving, t=0.76, v_t=0.0, x=0.02)

    assert avoid_slip(moving, ON_STONES, REQUEST).phase is StancePhase.BACK_OFF
    again = avoid_slip(resting, ON_STONES, REQUEST)
    assert (again.phase, again.x0) == (StancePhase.EASED, 0.02)


def test_a_foot_that_slipped_pushes_at_once_with_what_is_left_and_then_with_more():
    again = StanceCommand(0.0, 5.0, StancePhase.EASED, since=0.8, most=1.0, x0=0.02)
    command = again
    forces = []
    for k in range(1, 26):
        sample = replace(resting(command, 0.8 + 0.02 * k), x=0.021)
        command = avoid_slip(sample, ON_STONES, REQUEST)
        forces.append(command.F_t)

    assert forces[4] == pytest.approx(1.1)  # 0.1 s at 20 N/s, and 1 N/s
    assert forces[-1] == pytest.approx(1.5)


@pytest.mark.parametrize("phase", [StancePhase.PUSH, StancePhase.EASED])
def test_the_impulse_ends_a_stance_and_three_seconds_do(phase):
    # 4.2 N s are asked for; 4 N let go at 100 N/s bring 0.08 of them
    nearly, late = pushing(4.0, t=0.8, impulse=4.15), pushing(4.0, t=3.0, impulse=1.0)
    last = replace(nearly.last, phase=phase)
    nearly, late = (
        avoid_slip(replace(sample, last=last), ON_STONES, REQUEST)
        for sample in (nearly, late)
    )

    assert nearly.phase is StancePhase.RELEASE
    assert (late.phase, late.F_t) == (StancePhase.DONE, 0.0)


def test_the_oracle_takes_three_quarters_of_what_is_there():
    told = replace(ON_STONES, capacity=4.0)

    assert oracle(pushing(6.0, t=0.5), told, REQUEST).F_t == pytest.approx(3.0)


def test_what_is_asked_for_is_the_impulse():
    ticks = np.arange(0.0, 1.2, 0.001)
    asked = [REQUEST.asked(float(t)) for t in ticks]

    assert max(asked) == REQUEST.peak
    assert sum(asked) * 0.001 == pytest.approx(REQUEST.impulse, rel=1e-3)


@pytest.mark.parametrize(
    ("peak", "risk"),
    [(3.9, 0.1), (10.1, 0.1), (6.0, 0.0), (6.0, 0.6), (math.nan, 0.1), (6.0, math.nan)],
)
def test_a_request_out_of_range_is_refused(peak, risk):
    with pytest.raises(SettingsError, match="expected"):
        StanceRequest(peak, risk)
