import sys
from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.powered_tests import PoweredTestGoal, PoweredTestKind
from acquisition.control_loop.states import ArmState
from acquisition.devices import ArmReading, PositionJump
from wam.control.controller import FootController
from wam.control.joint_lock import LockGains
from wam.control.soft_walls import SoftWalls, Walls
from wam.model.gravity import compensation

S = 1_000_000_000
DOWN = np.array([0, 0.9, 0, 1.6, 0, np.pi - 2.5, 0.2])
MASS = 0.3
POWERED = [ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP, ArmState.GUIDE]


def reading(seconds, *, q=DOWN, qd=None, qd7_raw=0.0):
    return ArmReading(
        host_ns=int(seconds * S),
        arm_ns=0,
        counts=[0] * 7,
        q=q,
        qd=np.zeros(7) if qd is None else qd,
        qd7_raw=qd7_raw,
        fresh=0x7F,
        is_complete=True,
        missing_cycles=0,
    )


@pytest.fixture
def law(foot_model):
    return FootController(foot_model, MASS)


def moved(joint7):
    q = DOWN.copy()
    q[6] += joint7
    return q


def test_floating_is_gravity_compensation_only(law, foot_model):
    law.enter(ArmState.FLOAT, reading(0.0))
    tau, gravity = law.torque(reading(0.0))
    assert np.array_equal(tau, gravity)
    assert np.array_equal(gravity, compensation(foot_model, DOWN, 0.0))


@pytest.mark.parametrize(("seconds", "mass"), [(1.0, 0.15), (2.0, 0.3), (60.0, 0.3)])
def test_the_virtual_mass_is_ramped_in(law, foot_model, seconds, mass):
    law.enter(ArmState.FLOAT, reading(0.0))
    gravity = law.torque(reading(seconds))[1]
    assert np.allclose(gravity, compensation(foot_model, DOWN, mass), atol=1e-12)


@pytest.mark.parametrize("state", [ArmState.HOLD, ArmState.DAMP, ArmState.GUIDE])
def test_the_virtual_mass_is_ramped_out(law, foot_model, state):
    law.enter(ArmState.FLOAT, reading(0.0))
    law.enter(state, reading(10.0))
    for seconds, mass in ((10.0, 0.3), (11.0, 0.15), (12.0, 0.0), (99.0, 0.0)):
        gravity = law.torque(reading(seconds))[1]
        assert np.allclose(gravity, compensation(foot_model, DOWN, mass), atol=1e-12)


def test_floating_does_not_damp_joints_1_to_6(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    qd = np.full(7, 0.5)
    tau, gravity = law.torque(reading(5.0, qd=qd))
    assert np.array_equal(tau[:6], gravity[:6])


@pytest.mark.parametrize("state", [ArmState.HOLD, ArmState.DAMP, ArmState.GUIDE])
def test_holding_and_damping_brake_every_joint(law, foot_model, state):
    law.enter(state, reading(0.0))
    qd = np.linspace(-1.0, 1.0, 7) + 0.1
    tau, gravity = law.torque(reading(5.0, qd=qd))
    # At least as much as the vendor's: there are springs to be damped as well.
    kd = foot_model.constants.kd
    assert (np.abs(tau[:6] - gravity[:6]) >= np.abs(kd[:6] * qd[:6])).all()
    assert ((tau[:6] - gravity[:6]) * qd[:6] < 0.0).all()


def test_torques_do_not_jump_from_float_to_hold_at_rest(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    before = law.torque(reading(5.0, q=moved(0.01)))[0]
    law.enter(ArmState.HOLD, reading(5.0, q=moved(0.01)))
    after = law.torque(reading(5.0, q=moved(0.01)))[0]
    assert np.allclose(before, after, atol=1e-12)


@pytest.mark.parametrize("state", POWERED)
def test_joint_7_is_locked_at_its_position(law, state):
    law.enter(state, reading(0.0))
    tau, gravity = law.torque(reading(5.0, q=moved(0.01)))
    assert tau[6] - gravity[6] == pytest.approx(-0.2, abs=1e-12)
    assert law.joint7_offset(reading(5.0, q=moved(0.01))) == pytest.approx(0.01)


def test_the_lock_is_damped_on_the_raw_difference(law):
    law.enter(ArmState.HOLD, reading(0.0))
    qd = np.full(7, 3.0)  # the filtered velocity must not matter
    tau, gravity = law.torque(reading(5.0, qd=qd, qd7_raw=1.0))
    assert tau[6] - gravity[6] == pytest.approx(-0.2, abs=1e-12)


def test_the_lock_keeps_its_reference_from_float_to_hold(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    law.enter(ArmState.HOLD, reading(5.0, q=moved(0.03)))
    assert law.joint7_offset(reading(5.0, q=moved(0.03))) == pytest.approx(0.03)


@pytest.mark.parametrize("state", [ArmState.IDLE, ArmState.UNKNOWN])
def test_idle_releases_joint_7(law, state):
    law.enter(ArmState.FLOAT, reading(0.0))
    law.enter(state, reading(1.0))
    assert law.joint7_offset(reading(1.0, q=moved(0.5))) == 0.0


def test_a_returned_torque_may_be_modified_by_the_caller(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    tau, gravity = law.torque(reading(1.0))
    kept = gravity.copy()
    tau += 1.0
    assert np.array_equal(gravity, kept)


def test_the_gains_of_the_lock_can_be_chosen(foot_model):
    law = FootController(foot_model, MASS, LockGains(kp=8.0))
    law.enter(ArmState.FLOAT, reading(0.0))
    tau, gravity = law.torque(reading(5.0, q=moved(0.01)))
    assert tau[6] - gravity[6] == pytest.approx(-0.08, abs=1e-12)


def with_walls(foot_model, torque=40.0):
    """Return a holding law with joint 4 in front of its upper wall, which is armed."""
    constants = foot_model.constants
    walls = Walls(
        tuple(constants.q_lower.tolist()),
        tuple(constants.q_upper.tolist()),
        (torque,) * 7,
        tuple(constants.kd.tolist()),
    )
    law = FootController(foot_model, MASS, walls=SoftWalls(walls))
    law.enter(ArmState.HOLD, reading(0.0))
    law.torque(reading(0.0))
    return law


def folded(depth):
    """Return a pose with joint 4 this deep in its upper wall [rad]."""
    q = DOWN.copy()
    q[3] = 3.1 - 0.1 + depth
    return q


@pytest.mark.parametrize("state", POWERED)
def test_a_wall_pushes_back_in_every_powered_state(foot_model, state):
    law = with_walls(foot_model)
    law.enter(ArmState.FLOAT, reading(0.5, q=folded(0.05)))  # held nowhere else
    law.enter(state, reading(1.0, q=folded(0.05)))
    tau, gravity = law.torque(reading(9.0, q=folded(0.05)))
    assert tau[3] - gravity[3] == pytest.approx(-40.0 / 0.2 * 0.05)
    assert np.delete(tau - gravity, 3) == pytest.approx(np.zeros(6), abs=1e-12)


def test_a_wall_torque_is_not_counted_as_gravity(foot_model):
    # A limit of torque may cut the push of a wall, but never the weight of the arm.
    law = with_walls(foot_model)
    gravity = law.torque(reading(9.0, q=folded(0.05)))[1]
    assert gravity == pytest.approx(foot_model.gravity(folded(0.05)), abs=1e-12)


def test_a_move_does_not_exceed_its_speed(law):
    law.enter(ArmState.HOLD, reading(0.0))
    goal = DOWN + np.array([0, 0, 0, 0.5, 0, 0, 0.2])
    assert law.move_to(goal, 0.1, reading(1.0)) == pytest.approx(0.5 / 0.1 + 0.2)
    assert law.move_to(goal, 0.5, reading(1.0)) == pytest.approx(2.0)


@pytest.mark.parametrize("speed", [0.0, -0.1, 0.51, float("nan")])
def test_an_invalid_speed_is_refused(law, speed):
    law.enter(ArmState.HOLD, reading(0.0))
    with pytest.raises(ValueError, match="rad/s"):
        law.move_to(DOWN, speed, reading(0.0))


@pytest.mark.parametrize("goal", [np.full(7, 4.0), np.full(7, np.nan), np.zeros(6)])
def test_an_unreachable_goal_is_refused(law, goal):
    law.enter(ArmState.HOLD, reading(0.0))
    with pytest.raises(ValueError, match="is not a pose"):
        law.move_to(goal, 0.5, reading(0.0))


def test_a_floating_arm_is_not_moved(law):
    law.enter(ArmState.FLOAT, reading(0.0))
    with pytest.raises(ValueError, match="hold only"):
        law.move_to(DOWN, 0.5, reading(0.0))


def test_a_move_from_a_hold_begins_with_the_torque_of_the_hold(law):
    """The springs of the hold are bent by as much as an unknown weight bends them."""
    law.enter(ArmState.HOLD, reading(0.0))
    law.torque(reading(1.0))
    sagged = DOWN.copy()
    sagged[1] += 0.001
    before, weight = law.torque(reading(2.0, q=sagged))
    law.move_to(DOWN + 0.01, 0.5, reading(2.0, q=sagged))
    after = law.torque(reading(2.0, q=sagged))[0]
    assert before[1] - weight[1] < -0.5
    assert after == pytest.approx(before, abs=1e-9)


def test_a_following_move_begins_without_a_torque_step(law):
    law.enter(ArmState.HOLD, reading(0.0))
    law.move_to(DOWN, 0.5, reading(0.0))
    sagged = DOWN.copy()
    sagged[1] += 0.001  # as far as an unknown weight of 2.5 N m pulls it
    before = law.torque(reading(1.0, q=sagged))[0]
    law.move_to(DOWN + 0.01, 0.5, reading(1.0, q=sagged))
    after = law.torque(reading(1.0, q=sagged))[0]
    assert after == pytest.approx(before, abs=1e-9)
    assert before[1] - law.torque(reading(1.0))[0][1] == pytest.approx(-2.5, abs=0.1)


@pytest.mark.parametrize("state", POWERED)
def test_a_rejected_position_gets_gravity_torque_only(law, foot_model, state):
    law.enter(state, reading(0.0))
    jump = PositionJump(motor=7, counts=400, speed=12.0)
    false = replace(reading(5.0, q=moved(0.03), qd7_raw=8.0), jump=jump)
    tau, gravity = law.torque(false)
    assert np.array_equal(tau, gravity)


PUSH = PoweredTestGoal(PoweredTestKind.RAMP, 2, 4.0)


def test_a_powered_test_replaces_gravity_compensation(law):
    law.enter(ArmState.HOLD, reading(0.0))
    law.start_powered_test(PUSH, reading(1.0))
    assert law.is_testing()
    tau, gravity = law.torque(reading(1.5))
    assert tau.tolist() == gravity.tolist() == [0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    law.start_powered_test(
        PoweredTestGoal(PoweredTestKind.REST), reading(2.0)
    )  # one after the other
    assert not law.torque(reading(2.5))[0].any()
    with pytest.raises(ValueError, match="moves in hold only"):
        law.move_to(DOWN, 0.5, reading(3.0))
    law.enter(ArmState.IDLE, reading(3.0))
    assert not law.is_testing()


@pytest.mark.parametrize("state", [s for s in ArmState if s is not ArmState.HOLD])
def test_a_powered_test_begins_only_in_hold(law, state):
    law.enter(state, reading(0.0))
    with pytest.raises(ValueError, match="powered test begins in hold only"):
        law.start_powered_test(PUSH, reading(1.0))
    assert not law.is_testing()


def test_the_heartbeat_test_is_limited_to_the_modules_timeout(law):
    law.enter(ArmState.HOLD, reading(0.0))
    with pytest.raises(ValueError, match="unwatched for too long"):
        law.start_powered_test(
            PoweredTestGoal(PoweredTestKind.SILENCE, seconds=0.4), reading(1.0)
        )
    law.start_powered_test(
        PoweredTestGoal(PoweredTestKind.SILENCE, seconds=0.3), reading(1.0)
    )
    assert not law.torque(reading(1.1))[0].any()


def test_no_powered_test_begins_in_a_move(law):
    law.enter(ArmState.HOLD, reading(0.0))
    law.move_to(DOWN, 0.5, reading(1.0))
    with pytest.raises(ValueError, match="powered test begins in hold only"):
        law.start_powered_test(PUSH, reading(1.0))
    assert law.is_moving()


def test_travel_excess_is_reported_only_in_a_powered_test(law):
    astray = DOWN + 0.05 * np.eye(7)[3]
    law.enter(ArmState.HOLD, reading(0.0))
    assert law.powered_test_excess(reading(0.5, q=astray), 9.0, is_powered=True) is None
    law.start_powered_test(PUSH, reading(1.0))
    assert law.powered_test_excess(reading(1.1), 0.0, is_powered=True) is None
    excess = law.powered_test_excess(reading(1.1, q=astray), 0.0, is_powered=True)
    assert excess.quantity == "the travel of joint 4"
    assert law.powered_test_excess(reading(1.1), 9.0, is_powered=True).unit == "J"
    assert (
        law.powered_test_excess(reading(1.2, q=astray), 9.0, is_powered=False) is None
    )
    assert law.powered_test_excess(reading(1.3, q=astray), 0.0, is_powered=True) is None


@pytest.mark.parametrize("state", ArmState)
def test_without_a_move_no_motor_is_flagged_as_stuck(law, state):
    law.enter(state, reading(0.0))
    assert law.stuck_motor() == 0


def test_many_cycles_do_not_grow_memory(foot_model):
    law = with_walls(foot_model)

    def compute(cycles):
        for i in range(cycles):
            seconds = 1.0 + 0.002 * i
            q = folded(0.05) if i % 2 else DOWN
            law.torque(reading(seconds, q=q, qd7_raw=0.01))
            law.joint7_offset(reading(seconds))

    for state in (ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP):
        law.enter(state, reading(0.0))
        compute(50)  # one-time allocations happen here
        before = sys.getallocatedblocks()
        compute(2000)
        assert sys.getallocatedblocks() - before < 100  # less than one in 20 cycles


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_hold_with_weight_stays_within_its_torque_share(foot_model, side):
    """Joints that carry weight are braked with full torque in both directions."""
    law = with_walls(foot_model)
    law.enter(ArmState.HOLD, reading(0.0))
    tau, gravity = law.torque(reading(5.0, qd=np.full(7, -side * 100.0)))
    assert abs(gravity[1]) > 5.0
    assert tau[:6] == pytest.approx(np.full(6, side * 0.9 * 40.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_hold_adds_nothing_to_a_weight_beyond_its_torque_share(foot_model, side):
    leaning = np.array([0, side * 0.9, 0, 0.3, 0, 0, 0.2])
    law = with_walls(foot_model, torque=4.0)
    law.enter(ArmState.FLOAT, reading(0.0, q=leaning))  # held nowhere else
    law.enter(ArmState.HOLD, reading(0.0, q=leaning))
    gravity = law.torque(reading(5.0, q=leaning))[1]
    assert -side * gravity[1] > 5.0
    falling = -np.sign(gravity) * 100.0
    assert law.torque(reading(5.0, q=leaning, qd=falling))[0][1] == gravity[1]
    rising = law.torque(reading(5.0, q=leaning, qd=-falling))[0][1]
    assert abs(rising) == pytest.approx(0.9 * 4.0)


def test_an_arm_that_floated_is_held_at_its_new_pose(law):
    law.enter(ArmState.HOLD, reading(0.0))
    law.enter(ArmState.FLOAT, reading(1.0))
    there = DOWN + np.array([0.1, -0.1, 0.1, 0.1, -0.1, 0.1, 0.0])
    law.enter(ArmState.HOLD, reading(2.0, q=there))
    tau, gravity = law.torque(reading(9.0, q=there))
    assert tau[:6] == pytest.approx(gravity[:6], abs=1e-9)


def test_a_move_does_not_depend_on_the_clock_origin(law):
    law.enter(ArmState.HOLD, reading(3.0))
    law.move_to(DOWN, 0.5, reading(3.0))
    sagged = DOWN.copy()
    sagged[1] += 0.001
    before = law.torque(reading(4.0, q=sagged))[0]
    law.move_to(DOWN + 0.01, 0.5, reading(4.0, q=sagged))
    assert law.torque(reading(4.0, q=sagged))[0] == pytest.approx(before, abs=1e-9)


def test_a_replacing_move_begins_at_the_present_reference(law):
    """Half-way of a long move another one begins: the goal of the PD does not jump."""
    goal = DOWN + np.array([0, 0, 0, 0.4, 0, 0, 0])
    law.enter(ArmState.HOLD, reading(3.0))
    law.move_to(goal, 0.5, reading(3.0))
    q = DOWN + np.array([0, 0, 0, 0.2, 0, 0, 0])
    half = reading(3.0 + 0.5 * 2.0 * np.sqrt(0.4 / 0.5), q=q)
    at_rest = law.torque(half)[1]
    law.move_to(DOWN, 0.5, half)
    assert law.torque(half)[0][3] == pytest.approx(at_rest[3], abs=0.2)
    law.enter(ArmState.HOLD, half)
    assert law.torque(half)[0][3] == pytest.approx(at_rest[3], abs=0.2)


@pytest.mark.parametrize(("state", "offset"), [("HOLD", 0.065), ("FLOAT", 0.5)])
def test_joint_7_follows_a_person_in_hold_but_not_in_a_trial(law, state, offset):
    law.enter(ArmState[state], reading(0.0))
    law.torque(reading(9.0, q=moved(0.5)))
    assert law.joint7_offset(reading(9.0, q=moved(0.5))) == pytest.approx(offset)


def test_a_hold_during_a_move_begins_with_the_torque_of_the_move(law):
    """The PD of the move pulls back by 1 mrad; its goal is far away."""
    goal = DOWN + np.array([0, 0, 0, 0.4, 0, 0, 0])
    law.enter(ArmState.HOLD, reading(3.0))
    law.move_to(goal, 0.5, reading(3.0))
    q = DOWN + np.array([0, 0, 0, 0.2 + 0.001, 0, 0, 0])
    half = reading(3.0 + 0.5 * 2.0 * np.sqrt(0.4 / 0.5), q=q)
    law.enter(ArmState.HOLD, half)
    tau, gravity = law.torque(half)
    assert tau[3] - gravity[3] == pytest.approx(-0.5, abs=0.05)  # 500 N m/rad


def test_the_lock_of_joint_7_fades_evenly_as_a_move_begins(law):
    law.enter(ArmState.HOLD, reading(0.0))
    law.move_to(DOWN, 0.5, reading(1.0))
    times = [t - early for t in (1.0, 1.25, 1.5, 2.0) for early in (0.002, 0.0)]
    torques = [law.torque(reading(t, q=moved(0.01)))[0][6] for t in times]
    tau = np.array(torques[1::2])  # those of cycles that follow one in time
    assert tau - tau[-1] == pytest.approx([-0.2, -0.1, 0.0, 0.0], abs=1e-9)
