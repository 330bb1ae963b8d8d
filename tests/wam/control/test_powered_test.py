from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.powered_tests import (
    PARTNERS,
    POWERED_TEST_LIMITS,
    PoweredTestGoal,
    PoweredTestKind,
)
from acquisition.devices import ArmReading, PositionJump
from wam.control.powered_tests import PoweredTest
from wam.model.constants import load_constants

CONSTANTS = load_constants()
WEIGHT = np.full(7, 4.0)
MS = 1_000_000


def reading(ms=0, **joints):
    """Return a reading; `j3=0.01` puts joint 3 there."""
    q = CONSTANTS.home.copy()
    for name, travel in joints.items():
        q[int(name[1]) - 1] += travel
    return ArmReading(
        host_ns=ms * MS,
        arm_ns=ms * MS,
        bus_ns=0,
        counts=[0] * 7,
        q=q,
        qd=np.zeros(7),
        qd7_raw=0.0,
        fresh=0x7F,
        is_complete=True,
        missing_cycles=0,
        jump=None,
        foreign_id=None,
        has_bus_error=False,
    )


def excess(test, now, energy=0.0, *, is_powered=True):
    return test.excess(now, energy, is_powered=is_powered)


LIMITS = POWERED_TEST_LIMITS
REST, GRAVITY = (
    PoweredTestGoal(PoweredTestKind.REST),
    PoweredTestGoal(PoweredTestKind.GRAVITY),
)


def pushed(kind, joint, sense):
    """Return a goal that pushes one joint."""
    return PoweredTestGoal(kind, joint, 5.0 * sense, 1.0)


def travel_rows():
    """Return each rule of travel: goal, joint, sense and limit [rad]."""
    for sense in (-1.0, 1.0):
        yield "rest", REST, 2, sense, LIMITS.rest[1]
        yield "gravity", GRAVITY, 2, sense, LIMITS.gravity * LIMITS.rest[1]
        for kind in (PoweredTestKind.RAMP, PoweredTestKind.LIFT):
            aim = (
                LIMITS.lift_travel if kind is PoweredTestKind.LIFT else LIMITS.reach[2]
            )
            goal = pushed(kind, 3, sense)
            yield f"{kind.name} ahead", goal, 3, sense, aim + LIMITS.beyond
            yield f"{kind.name} back", goal, 3, -sense, LIMITS.reach[2]
            yield f"{kind.name} partner", goal, PARTNERS[3], sense, LIMITS.partner
            yield f"{kind.name} other", goal, 4, sense, LIMITS.aside


@pytest.mark.parametrize(
    ("goal", "joint", "sense", "limit"),
    [pytest.param(*row, id=f"{name}-{row[2]:+.0f}") for name, *row in travel_rows()],
)
def test_travel_within_its_limit_passes_and_beyond_is_reported(
    goal, joint, sense, limit
):
    test = PoweredTest(goal, CONSTANTS, reading())
    assert excess(test, reading(**{f"j{joint}": 0.99 * sense * limit})) is None
    found = excess(test, reading(**{f"j{joint}": 1.01 * sense * limit}))
    assert f"joint {joint}" in found.quantity
    assert found.value == pytest.approx(1.01 * sense * limit)
    assert found.limit == pytest.approx(sense * limit)


def test_kinetic_energy_within_its_limit_passes_and_beyond_is_reported():
    test = PoweredTest(REST, CONSTANTS, reading())
    assert excess(test, reading(10), 0.99 * LIMITS.energy) is None
    found = excess(test, reading(10), 1.01 * LIMITS.energy)
    assert (found.quantity, found.limit, found.unit) == (
        *("kinetic energy", LIMITS.energy),
        "J",
    )


@pytest.mark.parametrize("joint", range(1, 8))
@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_ramp_grows_linearly_until_its_joint_has_moved_forward(sense, joint):
    test = PoweredTest(pushed(PoweredTestKind.RAMP, joint, sense), CONSTANTS, reading())
    reach = sense * LIMITS.reach[joint - 1]
    half = test.torque(reading(500), WEIGHT)
    assert half == pytest.approx(2.5 * sense * np.eye(7)[joint - 1])
    for short in (0.99, -1.01):
        assert test.torque(reading(2000, **{f"j{joint}": short * reach}), WEIGHT).any()
    moved = reading(2000, **{f"j{joint}": 1.01 * reach})
    assert not test.torque(moved, WEIGHT).any()
    assert not test.torque(reading(2000), WEIGHT).any()
    assert excess(test, reading(2000), is_powered=False) is None
    assert test.torque(reading(3000), WEIGHT).any()


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_a_lift_rises_at_its_speed_pauses_and_returns(sense):
    """A lift pulls a joint behind its reference and none on the reference."""
    test = PoweredTest(pushed(PoweredTestKind.LIFT, 4, sense), CONSTANTS, reading())
    up_s = LIMITS.lift_travel / LIMITS.lift_speed
    pause_s = 0.3
    for seconds, height in (
        *((0.0, 0.0), (0.25 * up_s, 0.25), (up_s, 1.0), (up_s + pause_s, 1.0)),
        *((1.25 * up_s + pause_s, 0.75), (1.99 * up_s + pause_s, 0.01)),
    ):
        travel = sense * height * LIMITS.lift_travel
        there = reading(1000 * seconds, j4=travel)
        assert test.torque(there, WEIGHT) == pytest.approx(np.zeros(7), abs=1e-3)
        behind = reading(1000 * seconds, j4=travel - 1e-3 * sense)
        pull = test.torque(behind, WEIGHT)[3]
        assert pull == pytest.approx(sense * 1e-3 * CONSTANTS.kp[3], abs=1e-3)


def test_without_power_the_arm_may_be_moved_and_the_ramp_waits():
    test = PoweredTest(
        PoweredTestGoal(PoweredTestKind.RAMP, 1, 8.0, 1.0), CONSTANTS, reading()
    )
    assert excess(test, reading(900, j4=-0.5), is_powered=False) is None
    assert excess(test, reading(902, j4=-0.5)) is None
    assert test.torque(reading(1400, j4=-0.5), WEIGHT)[0] == pytest.approx(4.0)


def test_gravity_torque_is_ramped_to_its_full_value():
    goal = PoweredTestGoal(PoweredTestKind.GRAVITY, seconds=2.0)
    test = PoweredTest(goal, CONSTANTS, reading())
    assert test.torque(reading(1000), WEIGHT) == pytest.approx(WEIGHT / 2)
    assert test.torque(reading(5000), WEIGHT) == pytest.approx(WEIGHT)


def test_a_lift_never_exceeds_its_torque_and_ends_at_zero():
    test = PoweredTest(
        PoweredTestGoal(PoweredTestKind.LIFT, 4, -6.0), CONSTANTS, reading()
    )
    assert test.torque(reading(1600), WEIGHT)[3] == -6.0
    for ms in (3502, 4000):
        assert not test.torque(reading(ms, j4=-0.01), WEIGHT).any()


def test_a_ramp_to_zero_torque_has_zero_torque():
    test = PoweredTest(PoweredTestGoal(PoweredTestKind.RAMP, 2), CONSTANTS, reading())
    for offset in (-0.02, 0.0, 0.02):
        assert not test.torque(reading(500, j2=offset), WEIGHT).any()


def test_a_lift_is_damped_and_clipped_in_both_directions():
    test = PoweredTest(
        PoweredTestGoal(PoweredTestKind.LIFT, 4, 5.0), CONSTANTS, reading()
    )
    moving = replace(reading(1700, j4=0.08), qd=0.1 * np.eye(7)[3])
    damped = test.torque(moving, WEIGHT)[3]
    assert damped == pytest.approx(-0.1 * CONSTANTS.kd[3], abs=1e-6)
    assert test.torque(reading(1700, j4=-0.02), WEIGHT)[3] == 5.0
    assert test.torque(reading(1700, j4=0.18), WEIGHT)[3] == -5.0


@pytest.mark.parametrize(("joint", "other"), PARTNERS.items())
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_partner_of_a_lifted_joint_is_held_within_its_limit(side, joint, other):
    test = PoweredTest(
        PoweredTestGoal(PoweredTestKind.LIFT, joint, 1.0), CONSTANTS, reading()
    )
    lifted = {f"j{joint}": 0.08}
    limit = 2.0 * CONSTANTS.coulomb[other - 1]
    far = test.torque(reading(1700, **lifted, **{f"j{other}": side}), WEIGHT)
    assert far[other - 1] == pytest.approx(-side * limit)
    near = 0.5 * limit / CONSTANTS.kp[other - 1]
    kept = test.torque(reading(1700, **lifted, **{f"j{other}": side * near}), WEIGHT)
    assert kept[other - 1] == pytest.approx(-side * 0.5 * limit)


@pytest.mark.parametrize("kind", PoweredTestKind)
def test_an_implausible_position_gets_no_torque(kind):
    test = PoweredTest(PoweredTestGoal(kind, 2, 5.0, seconds=0.3), CONSTANTS, reading())
    jumped = replace(reading(900), jump=PositionJump(motor=3, counts=900, speed=20.0))
    assert not test.torque(jumped, WEIGHT).any()


def test_a_rest_test_gives_no_torque():
    test = PoweredTest(PoweredTestGoal(PoweredTestKind.REST), CONSTANTS, reading())
    assert not test.torque(reading(900, j2=0.01), WEIGHT).any()


@pytest.mark.parametrize(
    "goal",
    [
        PoweredTestGoal(PoweredTestKind.REST),
        PoweredTestGoal(PoweredTestKind.GRAVITY, seconds=60.0),
        PoweredTestGoal(PoweredTestKind.RAMP, 1, -1.0, 0.001),
        PoweredTestGoal(PoweredTestKind.LIFT, 7, 1.0),
    ],
)
def test_goals_at_their_limits_are_accepted(goal):
    assert PoweredTest(goal, CONSTANTS, reading()).goal == goal


@pytest.mark.parametrize(
    "goal",
    [
        PoweredTestGoal(PoweredTestKind.RAMP, 0, 1.0),
        PoweredTestGoal(PoweredTestKind.LIFT, 8, 1.0),
        PoweredTestGoal(PoweredTestKind.GRAVITY, -1),
        PoweredTestGoal(PoweredTestKind.REST, 8),
        PoweredTestGoal(PoweredTestKind.RAMP, 1, 1.0, 60.1),
        PoweredTestGoal(PoweredTestKind.RAMP, 1, 1.0, float("nan")),
        PoweredTestGoal(PoweredTestKind.RAMP, 1, float("inf")),
        PoweredTestGoal(PoweredTestKind.RAMP, 1, float("nan")),
        PoweredTestGoal(PoweredTestKind.GRAVITY, seconds=0.0),
    ],
)
def test_invalid_goals_are_refused(goal):
    with pytest.raises(ValueError, match=r"no joint|is not a valid powered test"):
        PoweredTest(goal, CONSTANTS, reading())


def test_a_goal_is_encoded_with_defaults():
    """No joint, no torque and one second unless given."""
    wanted = [(float(number), 0.0, 0.0, 1.0) for number in range(5)]
    assert [PoweredTestGoal(kind).values for kind in PoweredTestKind] == wanted


def test_a_goal_round_trips_through_a_command():
    goal = PoweredTestGoal(PoweredTestKind.LIFT, 6, -1.5, 2.0)
    assert PoweredTestGoal.of((*goal.values, 0.0)) == goal
    assert PoweredTestGoal.of(replace(goal, joint=5).values) != goal
