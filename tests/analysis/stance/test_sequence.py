"""The sequence on the simulated ground: set down, loaded, asked, lifted, again."""

from itertools import pairwise

import pytest

from analysis.stance.interface import StanceRequest, risk_tables
from analysis.stance.outcomes import totals
from analysis.stance.policies import POLICIES
from analysis.stance.sequence import SoleView, StancePlan, StanceSequence
from studies.stances import KNOWN, StanceCase, claims
from tests.fakes.stance_bench import (
    TRAVEL,
    StanceBench,
    felt,
    learn_break_away,
    learn_foresight,
    record,
    stances,
    taught,
)

REQUEST = StanceRequest(6.0, 0.1)


def plan(policy: str, count: int) -> StancePlan:
    return StancePlan(POLICIES[policy], REQUEST, count, TRAVEL, 0.3)


def test_spots_are_apart_and_inside():
    spots = [plan("none", 1).spot(k) for k in range(60)]
    apart = [abs(b - a) for a, b in pairwise(spots)]

    assert min(apart) >= 2.0 * 0.037
    assert min(spots) > 0.02
    assert max(spots) < TRAVEL - 0.02


def test_constant_mu_holds_on_a_rough_plate_and_slides_on_a_smooth_one():
    rough = record(StanceBench("TF", 1, 0), plan("constant-mu", 1)).outcomes
    smooth = record(StanceBench("Tf", 1, 0), plan("constant-mu", 1)).outcomes

    assert rough[0].is_success
    assert rough[0].load == pytest.approx(12.0, abs=0.3)
    assert smooth[0].is_slip


def test_the_same_seed_gives_the_same_stances():
    first, second = (
        record(StanceBench("B15", 3, 1), plan("none", 1)).outcomes for _ in range(2)
    )

    assert first == second


def test_a_fresh_place_has_a_fresh_jam():
    bench = StanceBench("S0", 1, 0)
    made = record(bench, plan("oracle", 2))

    assert len({round(one.force, 6) for one in made.outcomes}) == 2
    assert made.is_over


@pytest.mark.parametrize(("short", "is_lowered"), [(0.015, True), (0.06, False)])
def test_a_foot_that_rests_short_of_its_spot_stands_there(short, is_lowered):
    asked = plan("none", 1)
    sequence = StanceSequence(asked)
    at = SoleView(x=asked.spot(0) - short, z=0.022, F_t=0.0, F_n=0.0)

    goals = [sequence.next_goal(at) for _ in range(400)]

    assert (goals[30].z < 0.0) is is_lowered
    assert sequence.is_stuck


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_avoid_slip_slips_as_asked_and_slides_less_than_constant_mu():
    pushes = {name: taught(name, 5) for name in ("S0", "B15", "TF")}
    learnt = learn_break_away(pushes)
    model = learn_foresight([one for name in pushes for one in felt(name, 5)])
    avoiding = StancePlan(
        POLICIES["avoid-slip"], REQUEST, 25, TRAVEL, 0.0, risk_tables(learnt)
    )
    seen = totals(stances("B15", avoiding, 5, 8, model), REQUEST)
    usual = totals(stances("B15", plan("constant-mu", 25), 5, 8, None), REQUEST)

    assert seen is not None
    assert usual is not None
    assert seen.slips == pytest.approx(0.1, abs=0.05)  # 200 stances
    assert seen.slid <= 0.5 * usual.slid
    assert seen.successes >= usual.successes


def test_a_claim_of_the_study_can_fail():
    made = record(StanceBench("Tf", 1, 0), plan("constant-mu", 1))
    one = totals(made.outcomes, REQUEST)
    assert one is not None
    judged = claims({StanceCase("S0", "avoid-slip", 0.1, KNOWN): one})

    assert [is_met for _, is_met in judged] == [False]
