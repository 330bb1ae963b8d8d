"""Too much load on the foot ends a trial, and beyond a second limit the arm holds."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.clock import NS_PER_MS, PERIOD_NS
from acquisition.control_loop.contact import (
    GROWTH_NS,
    LASTING_NS,
    STANDING,
    Contact,
    ContactState,
    check_contact,
    contact_of,
)
from acquisition.control_loop.faults import (
    OK,
    Action,
    ContactExcess,
    Fault,
    ForceGrowth,
)
from acquisition.control_loop.states import ArmState
from acquisition.devices import PositionJump
from acquisition.sample import Sample
from tests.acquisition.control_loop.test_cycle import Bench, Observer
from tests.acquisition.control_loop.test_guard import LIMITS

START_NS = 10**10
HERE = (0.7, 0.0, 0.1)
CYCLES = LASTING_NS // PERIOD_NS
GROWTH = LIMITS.contact_growth


def load(force=0.0, moment=0.0, sole=HERE, *, is_saturated=False):
    return Contact(force, moment, is_saturated, sole)


def follow(loads, *, is_recording=True, is_moving=False, state=None):
    """Return the first verdict that is not OK, and its cycle."""
    state = state or ContactState()
    for cycle, seen in enumerate(loads):
        now_ns = START_NS + cycle * PERIOD_NS
        state, verdict = check_contact(
            LIMITS,
            state,
            now_ns,
            seen,
            is_recording=is_recording,
            is_moving=is_moving,
        )
        if verdict is not OK:
            return verdict, cycle
    return OK, len(loads)


FORCE = (LIMITS.contact_force, LIMITS.contact_force_hold)  # end of trial, hold
MOMENT = (LIMITS.contact_moment, LIMITS.contact_moment_hold)
MOVE = LIMITS.contact_force_move
ACTIONS = (Action.END_TRIAL, Action.HOLD)
OVER = [
    *(
        (load(force=1.01 * limit), Fault.CONTACT_FORCE, action, limit)
        for limit, action in zip(FORCE, ACTIONS, strict=True)
    ),
    *(
        (load(moment=1.01 * limit), Fault.CONTACT_MOMENT, action, limit)
        for limit, action in zip(MOMENT, ACTIONS, strict=True)
    ),
]


@pytest.mark.parametrize(("seen", "fault", "action", "limit"), OVER)
def test_a_load_beyond_a_limit_is_a_fault_after_its_duration(
    seen, fault, action, limit
):
    verdict, cycle = follow([seen] * 20)
    assert (verdict.fault, verdict.action, cycle) == (fault, action, CYCLES)
    assert verdict.detail == ContactExcess(max(seen.force, seen.moment), limit)


def test_a_load_at_its_limit_is_not_a_fault():
    assert follow([load(FORCE[0], MOMENT[0])] * 500)[0] is OK


def test_a_load_at_the_limit_of_hold_does_not_hold_the_arm():
    at_both = load(FORCE[1], MOMENT[1])
    assert follow([at_both] * 500, is_recording=False)[0] is OK


def test_contact_in_a_move_makes_the_arm_hold():
    moving = {"is_recording": False, "is_moving": True}
    beyond = 1.01 * MOVE
    verdict, cycle = follow([load(beyond)] * 20, **moving)
    assert (verdict.fault, verdict.action) == (Fault.CONTACT_MOVE, Action.HOLD)
    assert (verdict.detail, cycle) == (ContactExcess(beyond, MOVE), CYCLES)
    assert follow([load(MOVE)] * 20, **moving)[0] is OK
    assert follow([load(beyond)] * 20, is_recording=False)[0] is OK
    brief = [*[load(2.0 * MOVE)] * CYCLES, load()]
    assert follow(brief * 3, **moving)[0] is OK


def test_a_move_does_not_hide_a_load_beyond_the_hold_limit():
    seen = load(1.01 * FORCE[1])
    verdict, _ = follow([seen] * 20, is_moving=True, is_recording=False)
    assert (verdict.fault, verdict.detail.limit) == (Fault.CONTACT_FORCE, FORCE[1])


def test_a_brief_blow_is_not_a_fault():
    blow = [load(4.0 * FORCE[0], 4.0 * MOMENT[0])] * CYCLES + [load(force=20.0)]
    assert follow(blow * 5)[0] is OK


@pytest.mark.parametrize(("seen", "fault", "action", "limit"), OVER)
def test_outside_a_trial_only_the_hold_limit_counts(seen, fault, action, limit):
    verdict, _ = follow([seen] * 20, is_recording=False)
    assert verdict.action is (action if action is Action.HOLD else Action.NONE)


def test_a_saturated_sensor_ends_a_trial_after_its_duration():
    beyond = load(is_saturated=True)
    verdict, cycle = follow([beyond] * 100)
    assert (verdict.fault, verdict.action) == (Fault.FT_SATURATED, Action.END_TRIAL)
    # Tolerated up to its limit; the first cycle beyond it ends the trial.
    assert cycle == LIMITS.ft_saturated_ms * NS_PER_MS // PERIOD_NS + 1
    assert follow([beyond] * 100, is_recording=False)[0] is OK
    assert follow(([beyond] * 50 + [load()]) * 4)[0] is OK


def ramp(slope, seconds=2.0, speed=0.0, least=10.0):
    """Return the loads of a force that grows by `slope` [N/s] on a moving foot."""
    x, y, z = HERE
    return [
        load(least + slope * t, sole=(x - speed * t, y, z))
        for t in np.arange(0.0, seconds, 0.002).tolist()
    ]


def test_a_force_that_grows_on_a_foot_at_rest_ends_a_trial():
    verdict, cycle = follow(ramp(95.0, 0.9))
    assert (verdict.fault, verdict.action) == (Fault.CONTACT_GROWTH, Action.END_TRIAL)
    assert cycle * 0.002 < 0.7
    assert verdict.detail == ForceGrowth(pytest.approx(1.05 * GROWTH, rel=0.1), GROWTH)


def steps(*forces):
    """Return the loads of forces that stay for 50 ms each, then change at once."""
    return [load(force) for force in forces for _ in range(25)]


def test_force_growth_is_judged_once_its_window_has_data():
    """Points are 50 ms apart; the last one comes 50 ms before the window ends."""
    verdict, cycle = follow(steps(10.0, *[60.0] * 12))
    assert verdict.fault is Fault.CONTACT_GROWTH
    assert cycle * PERIOD_NS == GROWTH_NS - 50 * NS_PER_MS
    assert verdict.detail == ForceGrowth(50.0, GROWTH)


def test_force_growth_is_measured_over_its_window():
    """The first point counts until the window ends, and is dropped at the next one."""
    verdict, cycle = follow(steps(10.0, *[30.0] * 8, *[60.0] * 5))
    at = (verdict.fault, cycle * PERIOD_NS)
    assert at == (Fault.CONTACT_GROWTH, GROWTH_NS)
    assert follow(steps(10.0, *[30.0] * 9, *[60.0] * 5))[0] is OK


@pytest.mark.parametrize("direction", [(-1, 0, 0), (0, 1, 0), (0, 0, -1)])
@pytest.mark.parametrize(
    ("share", "fault"), [(0.99, Fault.CONTACT_GROWTH), (1.01, None)]
)
def test_a_foot_that_moves_less_than_the_limit_is_at_rest(direction, share, fault):
    begun, grown = steps(10.0), steps(*[60.0] * 12)
    moved = tuple(np.array(HERE) + share * STANDING * np.array(direction))
    later = [seen._replace(sole=moved) for seen in grown]
    assert follow(begun + later)[0].fault is fault


@pytest.mark.parametrize("cycles", [100, 300])
def test_a_force_on_a_moving_foot_is_not_growth(cycles):
    """The growth limit is almost zero: only the motion prevents the fault."""
    limits, state = replace(LIMITS, contact_growth=0.1), ContactState()
    for cycle in range(cycles):
        seen = load(20.0 + 0.2 * cycle, sole=(0.003 * cycle, 0.0, 0.0))
        now_ns = START_NS + cycle * PERIOD_NS
        state, verdict = check_contact(limits, state, now_ns, seen, is_recording=True)
        assert verdict is OK


def test_a_dip_of_the_force_delays_or_prevents_a_growth_fault():
    """The ninth or the last of ten points has less force."""
    early = steps(10.0, *[60.0] * 7, 30.0, *[60.0] * 5)
    verdict, cycle = follow(early)
    at = (verdict.fault, cycle * PERIOD_NS)
    assert at == (Fault.CONTACT_GROWTH, GROWTH_NS)
    assert follow(steps(10.0, *[60.0] * 8, 30.0, *[60.0] * 5))[0] is OK
    for_one_cycle = steps(10.0, *[60.0] * 14)
    for_one_cycle[9 * 25] = load(30.0)
    assert follow(for_one_cycle)[0] is OK


def test_slow_growth_or_growth_on_a_moving_foot_is_not_a_fault():
    assert follow(ramp(60.0, 1.4))[0] is OK
    assert follow(ramp(95.0, 0.9, speed=0.01))[0] is OK
    assert follow(ramp(95.0, 0.9), is_recording=False)[0] is OK


def test_a_knock_on_a_foot_at_rest_is_not_growth():
    quiet, knock = [load(20.0)] * 300, [load(90.0)] * 4
    assert follow((quiet + knock) * 4)[0] is OK


def test_contact_is_not_judged_without_a_fresh_force():
    assert follow([load(force=200.0)] * 4 + [None] * 50)[0] is OK


def test_the_contact_history_is_bounded():
    state = ContactState()
    for cycle, seen in enumerate(ramp(0.0, 5.0)):
        now_ns = START_NS + cycle * PERIOD_NS
        state, _ = check_contact(LIMITS, state, now_ns, seen, is_recording=True)
    assert len(state.points) <= 11


def test_the_load_of_a_sample_is_that_of_its_wrench_and_sole():
    sample = Sample()
    sample.wrench[:] = (3.0, 0.0, 4.0, 0.0, 1.0, 0.0)
    sample.foot_position[:] = (0.1, 0.2, 0.3)
    assert contact_of(sample, 0) == Contact(5.0, 1.0, False, (0.1, 0.2, 0.3))
    assert contact_of(sample, 0b100).is_saturated


def test_a_sample_without_a_force_has_no_load():
    nothing = contact_of(Sample(), 0)
    assert follow([nothing] * 400)[0] is OK


class FootUnderLoad(Observer):
    """Copies the wrench of the sensor to the foot."""

    def observe(self, reading, wrench, sample):
        if wrench is not None:
            sample.wrench[:] = wrench.wrench
        return super().observe(reading, wrench, sample)

    def set_bias(self, bias):
        """Ignore the bias."""


@pytest.fixture
def bench():
    bench = Bench()
    bench.observer = FootUnderLoad()
    bench.cycle = bench.make()
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    return bench


def test_a_load_ends_the_trial_and_keeps_the_arm_state(bench):
    bench.cycle.set_bias([0.0] * 6)
    bench.run(10, force=120.0)
    assert bench.reason == "contact-force"
    assert bench.state is ArmState.FLOAT
    assert not bench.cycle.is_recording


def test_a_load_beyond_the_hold_limit_makes_the_arm_hold(bench):
    bench.cycle.set_bias([0.0] * 6)
    bench.cycle.is_recording = False
    bench.run(10, force=160.0)
    assert (bench.state, bench.reason) == (ArmState.HOLD, "contact-force")


def test_a_load_that_grows_as_the_trial_ends_makes_the_arm_hold(bench):
    bench.cycle.set_bias([0.0] * 6)
    bench.run(10, force=120.0)
    bench.run(10, force=160.0)
    assert bench.state is ArmState.HOLD


def test_torques_are_sent_for_a_rejected_position_but_not_for_a_missing_one(bench):
    bench.arm.missing = 1
    sent = len(bench.arm.sent)
    bench.run()
    assert len(bench.arm.sent) == sent
    usual = bench.arm.reading
    jump = PositionJump(motor=3, counts=900, speed=20.0)
    bench.arm.reading = lambda now_ns: replace(usual(now_ns), jump=jump)
    bench.run()
    assert len(bench.arm.sent) == sent + 1
