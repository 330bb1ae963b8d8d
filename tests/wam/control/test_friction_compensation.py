"""A share of the dry friction is compensated, never more than its lower bound."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.states import ArmState
from acquisition.devices import ArmReading
from fakes.plant.friction import BristleFriction, draw_friction
from tests.sweeps import swept
from wam.control.controller import FootController
from wam.control.friction_compensation import (
    LARGEST_SHARE,
    FrictionCompensation,
    FrictionLowerBound,
    friction_lower_bound,
)
from wam.control.soft_walls import SoftWalls, Walls
from wam.model.constants import load_constants
from wam.model.friction import joint_coulomb, largest_motor_ratios

CONSTANTS = load_constants()
COUNTS = np.array(CONSTANTS.cts)
CYCLE = 2_000_000  # ns
POSE = np.array([0, 0.9, 0, 1.6, 0, np.pi - 2.5, 0.2])
TRUE = draw_friction(CONSTANTS, 1.0, None, np.zeros(7))
NOTHING = np.zeros(7)
KNOWN = FrictionLowerBound(TRUE.coulomb, TRUE.coulomb, NOTHING, NOTHING, NOTHING)


def reading(number, angles, q=POSE):
    """Return a reading of cycle `number` with the motors at `angles` [rad]."""
    counts = np.round(np.asarray(angles) * COUNTS / (2.0 * np.pi))
    return ArmReading(
        host_ns=number * CYCLE,
        arm_ns=0,
        counts=[int(count) for count in counts],
        q=q,
        qd=np.zeros(7),
        qd7_raw=0.0,
        fresh=0x7F,
        is_complete=True,
        missing_cycles=0,
    )


def after(compensation, angles, start=0, q=POSE):
    """Return the joint torques after a motor path, shape (n, 7)."""
    cycles = enumerate(angles, start)
    readings = [reading(n, row, q) for n, row in cycles]
    return np.array([compensation.torque(now, NOTHING) for now in readings])


def turning(joint, reach, cycles=200):
    """Return the motors' path while one joint turns by `reach` [rad] at one speed."""
    angles = np.zeros((cycles, 7))
    angles[:, joint] = np.linspace(0.0, reach, cycles)
    return angles @ CONSTANTS.j2mp.T


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_turning_joint_is_compensated_in_the_direction_of_motion(joint, sign):
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    tau = after(compensation, turning(joint, sign * 0.3))[-1]
    whole = joint_coulomb(CONSTANTS, TRUE.coulomb)[joint]
    assert tau[joint] == pytest.approx(sign * 0.7 * whole, rel=1e-3)


def test_an_arm_that_never_moved_is_not_compensated():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.8)
    assert not after(compensation, np.zeros((500, 7))).any()


def test_one_count_of_jitter_is_hardly_compensated():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.8)
    angles = np.zeros((500, 7))
    angles[::2] = 2.0 * np.pi / COUNTS
    tau = np.abs(after(compensation, angles)).max(axis=0)
    assert np.all(tau < 0.05 * joint_coulomb(CONSTANTS, TRUE.coulomb))


def test_compensation_persists_while_a_turned_joint_rests():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    angles = turning(1, 0.3)
    moving = after(compensation, angles)[-1]
    resting = after(compensation, np.tile(angles[-1], (500, 1)), 200)[-1]
    assert np.allclose(resting, moving, atol=1e-12)


@pytest.mark.parametrize("share", [-0.01, 0.81, float("nan")])
def test_compensation_shares_that_could_move_the_arm_are_refused(share):
    with pytest.raises(ValueError, match=r"share .* is outside 0\.\.0\.8"):
        FrictionCompensation(CONSTANTS, KNOWN, share)


def test_a_share_of_zero_does_not_compensate():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.0)
    assert not after(compensation, turning(1, 0.3)).any()


def test_uncertain_friction_is_compensated_less():
    doubtful = replace(KNOWN, error=np.full(7, 0.5))
    tau = after(FrictionCompensation(CONSTANTS, doubtful, 0.8), turning(1, 0.3))[-1]
    whole = joint_coulomb(CONSTANTS, TRUE.coulomb)[1]
    assert tau[1] * (1.0 + 0.5) <= 0.9 * whole * (1.0 + 1e-9)


def test_the_known_friction_is_below_the_true_friction_everywhere():
    friction = replace(
        TRUE,
        asymmetry=0.1 * TRUE.coulomb,
        ripple_sin=np.full(7, 0.05),
        load=np.full(7, 0.03),
        load_at=2.0 * TRUE.coulomb,
    )
    known = friction_lower_bound(friction, 0.02 * TRUE.coulomb, 0.02 * TRUE.coulomb)
    angles = np.linspace(0.0, 2.0 * np.pi, 50)[:, None] * np.ones(7)
    for sense, level in ((1.0, known.forward), (-1.0, known.backward)):
        rubs = friction.dry(angles, friction.load_at, np.full(7, sense)).min(axis=0)
        assert np.all(level <= rubs)
        assert np.all(level >= 0.8 * rubs)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 2.0])
def test_a_less_loaded_motor_is_compensated_less(share):
    at = np.abs(np.linalg.inv(CONSTANTS.j2mp).T @ np.array([0, 20.0, 0, 0, 0, 0, 0]))
    friction = replace(TRUE, load=np.full(7, 0.04), load_at=at)
    known = friction_lower_bound(friction, NOTHING, NOTHING)
    compensation = FrictionCompensation(CONSTANTS, known, 0.7)
    load_torque = np.array([0.0, share * 20.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for number, angles in enumerate(turning(1, 0.3)):
        tau = compensation.torque(reading(number, angles), load_torque)
    motors = np.linalg.inv(CONSTANTS.j2mp).T @ load_torque
    rubs = friction.dry(angles, motors, np.sign(angles))
    assert tau[1] <= 0.7 * joint_coulomb(CONSTANTS, rubs)[1] + 1e-9
    if share <= 1.0:
        assert tau[1] == pytest.approx(0.7 * joint_coulomb(CONSTANTS, rubs)[1])


def test_friction_that_may_be_zero_is_not_compensated():
    known = friction_lower_bound(TRUE, TRUE.coulomb, NOTHING)
    assert not known.forward.any()
    assert not known.backward.any()


@pytest.mark.parametrize("seed", swept(range(8), {0, 1}))
def test_overcompensated_random_motion_never_gains_energy(seed):
    """The work of compensation and true friction on closed paths is negative.

    The margin is the energy stored in the compensation's bristles.
    """
    known = replace(KNOWN, forward=1.2 * TRUE.coulomb, backward=1.2 * TRUE.coulomb)
    compensation = FrictionCompensation(CONSTANTS, known, LARGEST_SHARE)
    random = np.random.default_rng(seed)
    steps = random.normal(size=(3000, 7)).cumsum(axis=0)
    steps *= random.uniform(1e-4, 1e-2) / np.abs(steps).max(axis=0)
    path = np.concatenate((steps, steps[::-1]))
    bristles = BristleFriction(TRUE, np.array(CONSTANTS.drive_inertia), 0.002)
    gained, before = 0.0, np.zeros(7)
    largest = 0.0
    for number, angles in enumerate(path):
        turned = angles - before
        speeds = (turned / 0.002).tolist()
        bristles.take(speeds)
        friction = np.array(bristles.torques(speeds))
        bristles.follow(speeds)
        tau = compensation.torque(reading(number, angles), NOTHING)
        motors = np.linalg.solve(CONSTANTS.j2mp.T, tau)
        gained += float((motors + friction) @ turned)
        largest = max(largest, gained)
        before = angles
    held = float((0.96 * TRUE.coulomb * 4.0 * TRUE.presliding).sum())
    assert gained <= 0.0
    assert largest <= held


@pytest.mark.parametrize("state", [ArmState.HOLD, ArmState.DAMP, ArmState.IDLE])
def test_compensation_fades_after_leaving_float(foot_model, state):
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    law = FootController(foot_model, 0.0, friction=compensation)
    law.enter(ArmState.FLOAT, reading(0, NOTHING))
    for number, angles in enumerate(turning(1, 0.3)):
        tau, gravity = law.torque(reading(number, angles))
    pushed = tau - gravity
    assert pushed[1] > 1.0
    law.enter(state, reading(200, turning(1, 0.3)[-1]))
    faded = [
        law.torque(reading(number, turning(1, 0.3)[-1]))[0] - gravity
        for number in range(200, 252)
    ]
    steps = np.abs(np.diff([pushed, *faded], axis=0)).max()
    assert steps <= 0.03 * pushed.max() + 1e-9
    assert np.abs(faded[-1]).max() < 1e-9


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_fading_compensation_leaves_a_hold_its_torque_limit(foot_model, sign):
    """Joint 1 carries no weight: nine tenths of 1 N m, less than the compensation."""
    walls = Walls(
        tuple(CONSTANTS.q_lower), tuple(CONSTANTS.q_upper), (1.0,) * 7, (0.0,) * 7
    )
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    law = FootController(foot_model, 0.0, walls=SoftWalls(walls), friction=compensation)
    law.enter(ArmState.FLOAT, reading(0, NOTHING))
    path = turning(0, sign * 0.3)
    for number, angles in enumerate(path):
        tau, gravity = law.torque(reading(number, angles))
    assert sign * (tau - gravity)[0] > 1.0
    law.enter(ArmState.HOLD, reading(200, path[-1]))
    tau, gravity = law.torque(reading(200, path[-1]))
    assert sign * tau[0] == pytest.approx(0.9)


def test_joint_7_is_not_compensated(foot_model):
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    law = FootController(foot_model, 0.0, friction=compensation)
    law.enter(ArmState.FLOAT, reading(0, NOTHING))
    for number, angles in enumerate(turning(6, 0.02)):
        tau, gravity = law.torque(reading(number, angles))
    assert tau[6] == gravity[6]


def test_compensation_ends_inside_a_soft_wall(foot_model):
    upper = CONSTANTS.q_upper.copy()
    upper[1] = POSE[1] + 0.05  # 50 mrad inside its wall
    walls = Walls(
        tuple(CONSTANTS.q_lower.tolist()),
        tuple(upper.tolist()),
        tuple([30.0] * 7),
        tuple([0.0] * 7),
    )
    free = after(FrictionCompensation(CONSTANTS, KNOWN, 0.7), turning(1, 0.3))[-1]
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    depth = SoftWalls(walls).depth(POSE)
    for number, angles in enumerate(turning(1, 0.3)):
        tau = compensation.torque(reading(number, angles), NOTHING, depth)
    assert free[1] > 1.0
    assert tau[1] == 0.0


def test_oscillation_too_fast_for_a_hand_disables_compensation():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.8)
    cycles = np.arange(1000)
    angles = np.zeros((1000, 7))
    angles[:, 0] = 0.02 * np.array(CONSTANTS.j2mp)[0, 0] * np.sin(cycles * 0.1)  # 8 Hz
    after(compensation, angles)
    assert compensation.oscillating_motor == 1
    assert not after(compensation, turning(1, 0.3), 2000)[-1].any()


def test_shaking_by_hand_does_not_disable_compensation():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.8)
    cycles = np.arange(2500)
    angles = np.zeros((2500, 7))
    angles[:, 0] = 0.2 * np.array(CONSTANTS.j2mp)[0, 0] * np.sin(cycles * 0.0251)
    after(compensation, angles)
    assert compensation.oscillating_motor == 0


REACH = np.array([4.0, 4.0, 4.0, 4.0, 8.0, 8.0, 8.0]) * 1e-3  # rad of the joint


def of_motors(tau):
    """Return torques of the joints as torques of the motors [N m]."""
    return np.linalg.solve(CONSTANTS.j2mp.T, tau)


@pytest.mark.parametrize("motor", range(7))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_bristle_deflects_by_the_motor_travel(motor, sign):
    angles = np.zeros((2, 7))
    angles[1, motor] = (
        sign * 0.5 * REACH[motor] * largest_motor_ratios(CONSTANTS)[motor]
    )
    tau = after(FrictionCompensation(CONSTANTS, KNOWN, 0.7), angles)[-1]

    wanted = np.zeros(7)
    wanted[motor] = sign * 0.5 * 0.7 * TRUE.coulomb[motor]
    counted = (
        2.0 * np.pi / COUNTS[motor] / (REACH * largest_motor_ratios(CONSTANTS))[motor]
    )
    assert of_motors(tau) == pytest.approx(wanted, abs=counted * TRUE.coulomb[motor])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_motor_jump_deflects_its_bristle_once(sign):
    angles = np.zeros((2, 7))
    angles[1, 1] = sign * 3.0 * REACH[1] * largest_motor_ratios(CONSTANTS)[1]
    tau = after(FrictionCompensation(CONSTANTS, KNOWN, 0.7), angles)[-1]

    assert of_motors(tau)[1] == pytest.approx(sign * 0.7 * TRUE.coulomb[1])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_direction_of_motion_has_its_own_friction(sign):
    known = replace(KNOWN, forward=TRUE.coulomb, backward=0.5 * TRUE.coulomb)
    angles = np.zeros((2, 7))
    angles[1, 3] = sign * 3.0 * REACH[3] * largest_motor_ratios(CONSTANTS)[3]
    tau = after(FrictionCompensation(CONSTANTS, known, 0.7), angles)[-1]

    share = 0.7 if sign > 0.0 else -0.35
    assert of_motors(tau)[3] == pytest.approx(share * TRUE.coulomb[3])


@pytest.mark.parametrize(
    ("depth", "left"), [(0.0, 1.0), (0.005, 0.75), (-0.01, 0.5), (0.02, 0.0)]
)
def test_compensation_fades_over_the_outer_part_of_a_wall(depth, left):
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    whole = after(compensation, turning(1, 0.3))[-1]
    inside = np.zeros(7)
    inside[1] = depth
    now = reading(200, turning(1, 0.3)[-1])

    tau = compensation.torque(now, NOTHING, inside)
    assert tau[1] == pytest.approx(left * whole[1])


@pytest.mark.parametrize(
    ("turns", "gap", "is_over"), [(11, 40, False), (12, 45, True), (12, 46, False)]
)
def test_fast_repeated_reversals_are_oscillation(turns, gap, is_over):
    """A bristle goes to its other end every `gap` cycles of 2 ms."""
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    end = 3.0 * REACH[2] * largest_motor_ratios(CONSTANTS)[2]
    angles = np.zeros((turns * gap + 1, 7))
    for turn in range(turns):
        angles[1 + turn * gap : 1 + (turn + 1) * gap, 2] = end * (turn % 2 == 0)
    after(compensation, angles, 1000)

    assert (compensation.oscillating_motor == 3) is is_over
    assert compensation.metadata()["friction:swung_motor"] == str(3 * is_over)


def test_compensation_of_an_oscillating_motor_fades_evenly():
    """Its twelfth turn ends the compensation; from there it rests."""
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    end = 3.0 * REACH[2] * largest_motor_ratios(CONSTANTS)[2]
    angles = np.zeros((600, 7))
    last = 1 + 11 * 45
    for turn in range(0, 12, 2):
        angles[1 + turn * 45 : 1 + (turn + 1) * 45, 2] = end
    tau = after(compensation, angles)
    assert compensation.oscillating_motor == 3
    assert tau[last] == pytest.approx(-tau[last - 1])
    assert np.abs(tau[last]).max() > 0.1
    for cycles, share in ((0, 1.0), (10, 0.8), (25, 0.5), (50, 0.0), (90, 0.0)):
        assert tau[last + cycles] == pytest.approx(share * tau[last])


def test_remaining_compensation_fades_evenly():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    whole = after(compensation, turning(1, 0.3))[-1]
    compensation.stop(10**9)
    left = [compensation.fading_torque(10**9 + k * 25_000_000) for k in range(5)]

    for share, tau in zip((1.0, 0.75, 0.5, 0.25), left, strict=False):
        assert tau == pytest.approx(share * whole)
    assert left[4] is None


def test_uncertainties_are_combined_in_quadrature():
    known = friction_lower_bound(TRUE, 0.03 * TRUE.coulomb, 0.04 * TRUE.coulomb)

    assert known.forward == pytest.approx((1.0 - 1.96 * 0.05) * TRUE.coulomb)
    assert known.backward == pytest.approx((1.0 - 1.96 * 0.05) * TRUE.coulomb)
    assert known.error == pytest.approx(np.full(7, 1.96 * 0.03))


def test_a_far_deflected_bristle_slides_progressively():
    """z grows by the step up to 0.7, and by less and less up to 1."""
    travel = 0.1 * REACH[1] * largest_motor_ratios(CONSTANTS)[1]
    angles = np.zeros((13, 7))
    angles[:, 1] = travel * np.arange(13)
    tau = after(FrictionCompensation(CONSTANTS, KNOWN, 0.7), angles)

    z = [0.0]
    for _ in range(12):
        share = max((z[-1] - 0.7) / 0.3, 0.0)
        z.append(z[-1] + 0.1 * (1.0 - share * z[-1]))
    bent = np.linalg.solve(CONSTANTS.j2mp.T, tau.T)[1] / (0.7 * TRUE.coulomb[1])
    counted = 0.1 * 2.0 * np.pi / COUNTS[1] / travel  # share of a count
    assert bent == pytest.approx(np.array(z), abs=1.5 * counted)


def test_a_wall_ends_the_compensation_of_both_motors_of_its_differential():
    path = turning(0, 0.3) + turning(1, 0.3) + turning(2, 0.3) + turning(3, 0.3)
    free = after(FrictionCompensation(CONSTANTS, KNOWN, 0.7), path)[-1]
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    after(compensation, path)
    depth = np.array([0.0, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0])
    tau = compensation.torque(reading(200, path[-1]), NOTHING, depth)

    assert tau[[0, 3]] == pytest.approx(free[[0, 3]])
    assert tau[1:3] == pytest.approx([0.0, 0.0])


def test_repeated_one_way_motion_is_not_oscillation():
    compensation = FrictionCompensation(CONSTANTS, KNOWN, 0.7)
    angles = np.zeros((400, 7))
    back = -REACH[2] * largest_motor_ratios(CONSTANTS)[2]
    angles[:, 2] = np.where(np.arange(400) // 10 % 2, 0.9 * back, 0.0)
    after(compensation, angles)

    assert compensation.oscillating_motor == 0


def test_ripple_reduces_the_load_dependent_compensation():
    ripple = replace(
        TRUE,
        load=np.full(7, 0.03),
        ripple_sin=np.full(7, 0.06),
        ripple_cos=np.full(7, 0.08),
    )
    known = friction_lower_bound(ripple, NOTHING, NOTHING)

    assert known.load == pytest.approx(np.full(7, 0.03 * 0.9))
    assert known.forward == pytest.approx(0.9 * TRUE.coulomb)
