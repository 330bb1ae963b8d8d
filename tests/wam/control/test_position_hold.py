"""Springs and dampers hold each joint at rest within its limits."""

import numpy as np
import pytest

from acquisition.devices import ArmReading
from wam.control.position_control import GUIDE_SHARE, TORQUE_LIMIT, PositionHold
from wam.model.constants import load_constants

CONSTANTS = load_constants()
SOFT = PositionHold(CONSTANTS).stiffness
ZERO = np.zeros(7)
FAR = np.ones(7)  # rad; every spring is at its limit


def seen(q=ZERO, qd=ZERO, *, is_complete=True):
    return ArmReading(
        host_ns=0,
        arm_ns=0,
        counts=[0] * 7,
        q=np.array(q, dtype=float),
        qd=np.array(qd, dtype=float),
        qd7_raw=0.0,
        fresh=0x7F,
        is_complete=is_complete,
        missing_cycles=0,
    )


@pytest.fixture
def held():
    hold = PositionHold(CONSTANTS)
    hold.begin(ZERO)
    return hold


def test_hold_springs_are_softer_than_those_of_a_move(held):
    assert held.spring(seen(np.full(7, 1e-3))) == pytest.approx(-1e-3 * SOFT)
    assert (SOFT[:6] > 0.0).all()
    assert (SOFT[:6] < CONSTANTS.kp[:6]).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_no_spring_exceeds_the_torque_acceptable_to_a_person(held, side):
    assert held.spring(seen(side * FAR)) == pytest.approx(-side * TORQUE_LIMIT)


def test_a_guided_arm_has_a_reduced_spring_limit(held):
    assert held.torque(seen(FAR), is_guided=True) == pytest.approx(
        -GUIDE_SHARE * TORQUE_LIMIT
    )


def test_a_held_arm_is_damped_more_than_a_guided_one(held):
    qd = np.full(7, 0.5)
    damped = held.torque(seen(qd=qd))
    guided = held.torque(seen(qd=qd), is_guided=True)
    assert guided[:6] == pytest.approx(-0.5 * CONSTANTS.kd[:6])
    assert (damped[:6] < guided[:6]).all()
    assert held.torque(seen(qd=-0.5 * qd)) == pytest.approx(-0.5 * damped)


def test_the_reference_follows_a_pushed_joint(held):
    held.spring(seen(FAR))
    reach = TORQUE_LIMIT[:6] / SOFT[:6]
    here = FAR[:6] - reach  # where the springs are without load now
    assert held.spring(seen([*here, 0.0]))[:6] == pytest.approx(np.zeros(6), abs=1e-9)


def test_an_extrapolated_position_drags_no_reference_along(held):
    held.spring(seen(FAR, is_complete=False))
    assert held.spring(seen(ZERO)) == pytest.approx(ZERO)


@pytest.mark.parametrize(
    ("rate", "is_driven"), [(0.05, True), (0.051, False), (-0.2, True)]
)
def test_a_spring_does_not_exceed_its_return_speed(held, rate, is_driven):
    """The joint is below its reference: the spring pushes up."""
    q = np.full(7, -1e-3)
    spring = held.spring(seen(q, np.full(7, rate)))[:6]
    assert (spring > 0.0).all() == is_driven
    if not is_driven:
        assert held.spring(seen(q))[:6] == pytest.approx(np.zeros(6))


def test_a_spring_does_not_exceed_its_return_speed_downwards(held):
    q = np.full(7, 1e-3)
    assert (held.spring(seen(q, np.full(7, -0.05)))[:6] < 0.0).all()
    assert held.spring(seen(q, np.full(7, -0.051)))[:6] == pytest.approx(np.zeros(6))


def test_held_arms_stay_in_place(held):
    held.begin(FAR)
    assert held.spring(seen(np.full(7, 1e-3))) == pytest.approx(-1e-3 * SOFT)


def test_a_released_arm_is_held_at_its_new_pose(held):
    held.release()
    assert held.spring(seen(FAR)) == pytest.approx(ZERO)
    held.begin(FAR)
    assert held.spring(seen(FAR)) == pytest.approx(ZERO)


@pytest.mark.parametrize(("wanted", "given"), [(0.5, 0.5), (9.0, 1.0), (-9.0, -1.0)])
def test_a_spring_may_begin_with_a_torque_within_its_limit(wanted, given):
    """`wanted` and `given` are shares of the limits."""
    hold = PositionHold(CONSTANTS)
    hold.begin(FAR, wanted * TORQUE_LIMIT)
    assert hold.spring(seen(FAR)) == pytest.approx(given * TORQUE_LIMIT)


def test_joint_7_has_no_spring_and_no_damper(held):
    assert held.torque(seen(FAR, FAR))[6] == 0.0
    assert held.torque(seen(FAR, FAR), is_guided=True)[6] == 0.0
