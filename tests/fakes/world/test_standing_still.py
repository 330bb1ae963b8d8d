"""The true joints of the simulated arm stay at rest in hold."""

import numpy as np
import pytest

from acquisition.control_loop.faults import Fault
from acquisition.control_loop.limits import MAX_TORQUE_STEP
from acquisition.control_loop.states import ArmState
from tests.fakes.scenes import CONSTANTS
from tests.fakes.world.holding import SPEED, TORQUE, HoldBench
from wam.control.position_control import TORQUE_LIMIT

pytestmark = pytest.mark.slow

FRICTION = (0.02, 1.0)
DRIFT = 0.02  # rad
STILL = 5e-4  # rad in a second: wrist joints go on creeping by encoder counts
# The spring's return when a person lets go, limit / k, and some swing.
REACH = np.array([0.018, 0.010, 0.020, 0.024, 0.040, 0.040, 0.065])
# Share of the speed limit; joints 1 and 2 move the whole arm: no push does it faster.
FAST = (0.65, 0.6, 0.9, 0.9, 0.9, 0.9)
STOPPING = (0.10, 0.12, 0.05, 0.13, 0.08, 0.06)  # rad


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("error", [0.6, -0.4])
def test_a_wrong_foot_mass_moves_joints_little_and_briefly(friction, error):
    bench = HoldBench(friction=friction, error=error)
    q = bench.run(3.0)
    assert np.abs(q - bench.braked_q).max() < DRIFT
    assert np.ptp(q[-500:], axis=0).max() < STILL


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("torque", [4.0, -4.0])
def test_a_moderate_torque_at_joint_2_is_held(friction, torque):
    bench = HoldBench(friction=friction)
    q = bench.push(1, torque, 3.0)
    assert np.abs(q - bench.braked_q).max() < DRIFT
    assert np.ptp(q[-500:], axis=0).max() < STILL


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("joint", range(6))
def test_an_arm_that_is_pushed_away_stays_where_it_is_left(friction, joint):
    bench = HoldBench(friction=friction)
    dry = friction * CONSTANTS.coulomb[joint]
    pushed = bench.push(joint, 1.15 * TORQUE_LIMIT[joint] + dry, 1.5)[:, joint]
    left = bench.run(2.0)[:, joint]
    assert pushed[-1] - bench.braked_q[joint] > 2.0 * REACH[joint]  # the arm gave way
    assert pushed[-1] - left.min() < 0.7 * REACH[joint]
    assert np.ptp(left[-500:]) < 0.2 * REACH[joint]  # simulated dry friction creeps
    assert bench.cycle.status.verdict is None


@pytest.mark.parametrize("joint", range(6))
def test_a_slow_push_meets_at_most_the_limit(joint):
    bench = HoldBench()
    bench.sent.clear()
    bench.push(joint, 1.15 * TORQUE_LIMIT[joint], 1.0)
    largest = np.abs(bench.sent).max(axis=0)[joint]
    assert 0.8 * TORQUE_LIMIT[joint] < largest < 1.6 * TORQUE_LIMIT[joint]


def test_a_foot_that_is_twisted_far_stays_where_it_is_left():
    bench = HoldBench()
    twisted = bench.push(6, 1.4, 0.5)[:, 6]
    left = bench.run(1.5)[:, 6]
    assert twisted[-1] > 0.1
    assert twisted[-1] - left.min() < 1.5 * REACH[6]


@pytest.mark.parametrize("joint", range(6))
def test_a_joint_that_was_fast_is_stopped_within_bounds(joint):
    bench = thrown(joint, FAST[joint])
    begin = bench.plant.q.copy()
    bench.sent.clear()
    bench.cycle.request(ArmState.HOLD)
    q = bench.run(2.0)
    assert bench.cycle.status.verdict is None  # torques and speeds stayed in limits
    assert np.abs(q - begin).max() < STOPPING[joint]
    assert np.ptp(q[-250:], axis=0).max() < 2.0 * STILL
    steps = np.abs(np.diff(bench.sent, axis=0)).max(axis=0)
    assert (steps <= 1.05 * np.array(MAX_TORQUE_STEP) * TORQUE).all()


@pytest.mark.parametrize("joint", [0, 1])
def test_steady_motion_at_the_limit_is_not_a_push(joint):
    bench = thrown(joint, 0.9)
    assert bench.cycle.status.verdict.fault is Fault.KINETIC_ENERGY
    assert bench.plant.is_idle


def thrown(joint, share):
    """Return an arm with a joint at that share of its speed limit, in float."""
    bench = HoldBench()
    bench.run(0.6)  # a person may still carry an arm that has just got power
    bench.throw(joint, share * SPEED[joint])
    return bench


def test_hold_of_an_arm_at_rest_begins_without_a_torque_step():
    bench = HoldBench(friction=1.0)
    bench.enter(ArmState.FLOAT)
    bench.plant.q[0] += 1.8e-5  # half a count: at 0 the encoder flickers
    bench.run(0.5)
    bench.sent.clear()
    bench.enter(ArmState.HOLD)
    bench.run(0.02)
    assert np.abs(bench.sent)[:, :4].max() < 0.2


@pytest.mark.parametrize("joint", range(6))
def test_motion_after_a_blow_decays_without_drive_friction(joint):
    bench = HoldBench(friction=0.0)
    bench.run(0.5)
    bench.plant.qd[joint] = 0.1 if joint < 4 else 0.5
    q = bench.run(2.0)
    first, last = np.ptp(q[:250], axis=0), np.ptp(q[-250:], axis=0)
    assert first[joint] > 1e-3
    assert last.max() < 0.1 * first[joint]


def test_repeated_hold_requests_cause_no_creep():
    bench = HoldBench(error=0.6)
    for _ in range(50):
        bench.enter(ArmState.HOLD)
        q = bench.run(0.04)
    assert np.abs(q[-1] - bench.braked_q).max() < DRIFT


def test_damp_after_hold_keeps_the_pose():
    bench = HoldBench(error=0.6)
    bench.enter(ArmState.DAMP)
    q = bench.run(2.0)
    assert np.abs(q - bench.braked_q).max() < DRIFT


def test_a_guided_arm_follows_a_hand_and_stays_where_left():
    bench = HoldBench()
    bench.enter(ArmState.GUIDE)
    carried = bench.push(1, -9.0, 1.0)[:, 1]
    left = bench.run(2.0)[:, 1]
    assert bench.braked_q[1] - carried[-1] > 0.05
    assert left.max() - carried[-1] < REACH[1]
    assert np.ptp(left[-500:]) < STILL


@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("error", [0.6, -0.4])
def test_a_guided_arm_without_a_hand_stays_at_rest(friction, error):
    bench = HoldBench(friction=friction, error=error)
    bench.enter(ArmState.GUIDE)
    q = bench.run(3.0)
    assert np.abs(q - bench.braked_q).max() < DRIFT
    assert np.ptp(q[-500:], axis=0).max() < STILL
