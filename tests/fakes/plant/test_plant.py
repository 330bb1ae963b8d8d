from dataclasses import replace

import numpy as np
import pinocchio as pin  # noqa: TID253 - the arm cannot be simulated without it
import pytest

from fakes.plant.joints import JointLoads, JointState, JointStops
from fakes.plant.model import Support
from tests.fakes.scenes import (
    CONSTANTS,
    CYCLE_NS,
    FRAME,
    MODEL,
    TOOL,
    float_for,
    make_plant,
    release,
    send,
    sole,
)
from wam.model.arm_model import build_pinocchio, drive_inertia_matrix
from wam.model.constants import GRAVITY

S = 1_000_000_000


def total_inertia(plant):
    """Return M with the drives, and with the inertia of the person's forearm."""
    M = MODEL.mass_matrix(plant.q, with_drive=False) + forearm_inertia(plant.q)
    return M + np.diag(np.diag(drive_inertia_matrix(CONSTANTS)))


def energies(plant):
    """Return kinetic and potential energy [J]; the person carries the forearm."""
    bare = build_pinocchio(CONSTANTS, (TOOL.sensor, TOOL.foot))
    potential = pin.computePotentialEnergy(bare, bare.createData(), plant.q)
    return 0.5 * plant.qd @ total_inertia(plant) @ plant.qd, potential


def forearm_inertia(q):
    """Return the inertia that 1 kg, 30 mm above the tool plate, adds to M."""
    h = 1e-6
    steps = h * np.eye(7)
    columns = [
        (hand_point(q + step) - hand_point(q - step)) / (2 * h) for step in steps
    ]
    return np.array(columns) @ np.array(columns).T


def hand_point(q):
    position, rotation = MODEL.plate_pose(q)
    return position - 0.030 * rotation[:, 2]


def test_an_idle_arm_stays_on_its_stand():
    plant = make_plant()
    q = plant.q.copy()
    plant.short_windings([True] * 7)
    plant.advance(S // 2)
    assert plant.q.tolist() == q.tolist()


def sunk(seconds, windings=1.0, **options):
    """Return the distance that an unsupported idle arm has sunk [m]."""
    plant = make_plant(
        height=0.15, windings=windings, support=Support.NONE, has_hand=False, **options
    )
    plant.terrain = None
    before = sole(plant)
    plant.advance(round(seconds * S))
    return float(np.linalg.norm(sole(plant) - before))


def test_an_idle_arm_sinks_slowly_on_shorted_windings():
    assert 0.12 < sunk(0.5) < 0.16
    assert sunk(1.0) > 1.8 * sunk(0.5)  # the unsupported arm continues to sink


def test_an_arm_sinks_faster_the_less_its_windings_damp():
    assert sunk(0.5, windings=0.5) > 1.5 * sunk(0.5) > 2.0 * sunk(0.5, windings=2.0)


def test_friction_of_another_arm_slows_it_down_and_does_not_stop_it():
    assert 0.02 < sunk(0.5, friction=1.0) < sunk(0.5)


def test_an_arm_with_open_windings_falls():
    plant = make_plant(height=0.15)
    plant.hand.let_go()
    release(plant)
    plant.advance(S // 5)
    # 0.2 s of free fall would be 0.2 m; the inertia of drives and links slows it
    assert sole(plant)[2] < 0.15 - 0.03


def test_a_person_holding_an_arm_soon_supports_it():
    plant = make_plant(height=0.15)
    release(plant)
    for _ in float_for(plant, 0.5):
        pass
    plant.hand.rest()
    for _ in float_for(plant, 0.2):
        pass
    before = sole(plant)[2]
    plant.short_windings([True] * 7)
    plant.advance(plant.t_ns + S // 2)
    noticed = sole(plant)[2]
    plant.advance(plant.t_ns + 2 * S)
    assert 0.01 < before - noticed < 0.10
    assert noticed - 0.01 < sole(plant)[2] < before  # the person lifts slowly


def test_a_compensated_arm_without_friction_floats():
    plant = make_plant()
    release(plant)
    plant.hand.let_go()
    before = sole(plant)
    for _ in float_for(plant, 0.5):
        pass
    # torques in whole puck units would drift; these are not rounded
    assert sole(plant) == pytest.approx(before, abs=1e-6)


def swing(plant, seconds):
    """Let the arm swing by its own weight; return energies after every 20 ms."""
    release(plant)
    plant.hand.let_go()
    send(plant, np.zeros(7))
    found = [energies(plant)]
    for _ in range(round(seconds * 50)):
        plant.advance(plant.t_ns + 10 * CYCLE_NS)
        found.append(energies(plant))
    return np.array(found)


# From small oscillations about hanging down to half turns of the whole arm.
SWINGS = [
    [0.0, 2.9, 0.0, 0.4, 0.0, 0.3, 0.0],
    [0.3, 2.6, 0.4, 0.8, -0.4, 0.5, 0.3],
    [0.2, 1.5708, 0.1, 1.0, 0.1, 0.4, 0.0],
]


@pytest.mark.slow
@pytest.mark.parametrize("start", SWINGS)
def test_a_free_swing_keeps_its_energy(start):
    far = np.full(7, 100.0)
    plant = make_plant(constants=replace(CONSTANTS, q_lower=-far, q_upper=far))
    plant.q = np.array(start)
    kinetic, potential = swing(plant, 5.0).T
    assert kinetic.max() > 0.4
    assert np.ptp(kinetic[-50:]) > 0.2 * kinetic.max()  # it still swings
    assert kinetic + potential == pytest.approx(potential[0], abs=0.01 * kinetic.max())


def test_friction_takes_energy_away():
    loss = []
    for friction in (0.05, 0.5):
        kinetic, potential = swing(make_plant(friction=friction), 0.3).T
        loss.append(potential[0] - kinetic[-1] - potential[-1])
    assert loss[1] > 5.0 * loss[0] > 0.0


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_joint_stop_stops_a_joint(joint, side):
    plant = make_plant()
    release(plant)
    plant.hand.let_go()
    stops = CONSTANTS.q_upper if side > 0.0 else CONSTANTS.q_lower
    plant.q[joint] = stops[joint] - side * 0.02
    push = np.zeros(7)
    push[joint] = side * min(3.0, 100.0 * drive_inertia_matrix(CONSTANTS)[joint, joint])
    farthest = 0.0
    for _ in range(200):
        send(plant, MODEL.gravity(plant.q) + push)
        plant.advance(plant.t_ns + CYCLE_NS)
        farthest = max(farthest, side * (plant.q[joint] - stops[joint]))
    # 3 N m at most against 2000 N m/rad, and the impact; the joint stays at its stop
    assert 0.0 < farthest < 0.05
    assert abs(plant.q[joint] - stops[joint]) < 0.05
    assert np.abs(plant.qd).max() < 5.0


def test_a_torque_moves_the_joint_that_it_acts_on_by_its_inertia():
    plant = make_plant()
    release(plant)
    plant.hand.let_go()
    tau = np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    send(plant, MODEL.gravity(plant.q) + tau)
    wanted = np.linalg.solve(total_inertia(plant), tau)
    plant.advance(CYCLE_NS)
    assert plant.qd / 0.002 == pytest.approx(wanted, rel=0.02, abs=0.05)


def test_the_sensor_measures_the_weight_of_the_foot():
    plant = make_plant()
    load = plant.sensor_load(10 * CYCLE_NS)
    # the foot points down: the sensor's z axis too, so the weight pulls along it
    assert load[2] == pytest.approx(TOOL.foot.mass * GRAVITY, rel=1e-6)
    assert np.hypot(load[0], load[1]) < 1e-6


def felt_in_base(plant):
    """Return measured force and moment about the sole in the base frame."""
    load = np.array(plant.sensor_load(plant.t_ns))
    rotation = MODEL.sole_pose(plant.q)[1]
    arm = TOOL.sole - [0.0, 0.0, TOOL.sensor_height]
    moment = load[3:] - np.cross(arm, load[:3])
    return rotation @ load[:3], rotation @ moment


def test_the_sensor_measures_the_inertia_of_the_foot():
    plant = make_plant()
    release(plant)
    plant.hand.let_go()
    send(plant, np.zeros(7))
    plant.advance(CYCLE_NS)
    plant.advance(2 * CYCLE_NS)
    com = MODEL.foot_com_position
    q, qd, h = plant.q, plant.qd, 1e-4
    speed = (com(q + h * qd) - com(q - h * qd)) / (2.0 * h)
    # from rest, so the speed after two cycles is the mean acceleration times 4 ms
    wanted = TOOL.foot.mass * (np.array([0.0, 0.0, -GRAVITY]) - speed / 0.004)
    assert np.linalg.norm(wanted) < 0.9 * TOOL.foot.mass * GRAVITY  # it falls
    assert felt_in_base(plant)[0] == pytest.approx(wanted, abs=0.03)


class Pusher:
    """A ground that pushes with a given wrench."""

    stiffness = 1.0

    def __init__(self, contact):
        self.contact = contact

    def surface(self, x):
        return 0.0 * x

    def truth(self):
        return {}

    def step(self, dt, motion):
        return self.contact


@pytest.mark.parametrize("component", range(6))
def test_the_sensor_measures_force_and_moment_of_the_ground(component):
    plant = make_plant()
    plant.advance(CYCLE_NS)
    before = np.concatenate(felt_in_base(plant))
    wrench = np.zeros(6)
    wrench[component] = 1.5
    plant.terrain = Pusher((-wrench[0], *wrench[1:]))  # F_t is against x
    plant.advance(2 * CYCLE_NS)
    change = np.concatenate(felt_in_base(plant)) - before
    axes = FRAME.axes()
    in_terrain = np.concatenate([axes @ change[:3], axes @ change[3:]])
    assert in_terrain == pytest.approx(wrench, abs=1e-9)
    assert plant.contact_force == pytest.approx(wrench[:3])


@pytest.mark.parametrize("component", range(6))
def test_the_ground_moves_the_joints_through_the_jacobian_of_the_sole(component):
    plant = make_plant()
    release(plant)
    plant.hand.let_go()
    wrench = np.zeros(6)
    wrench[component] = 1.0 if component < 3 else 0.1
    plant.terrain = Pusher((-wrench[0], *wrench[1:]))
    axes, J = FRAME.axes(), MODEL.sole_jacobian(plant.q)
    tau = J[:3].T @ (axes.T @ wrench[:3]) + J[3:].T @ (axes.T @ wrench[3:])
    send(plant, MODEL.gravity(plant.q))
    wanted = np.linalg.solve(total_inertia(plant), tau)
    plant.advance(CYCLE_NS)
    assert plant.qd / 0.002 == pytest.approx(wanted, rel=0.03, abs=0.05)


def test_time_advances_in_whole_substeps_only():
    plant = make_plant()
    plant.advance(CYCLE_NS - 1)
    assert plant.t_ns == 3 * CYCLE_NS // 4
    plant.advance(CYCLE_NS)
    assert plant.t_ns == CYCLE_NS


def test_counts_are_those_of_motor_encoders():
    plant = make_plant()
    angle = CONSTANTS.j2mp @ plant.q
    counts = angle * np.array(CONSTANTS.cts) / (2.0 * np.pi)
    assert (counts - plant.counts() >= 0.0).all()
    assert (counts - plant.counts() < 1.0).all()


def test_the_truth_has_one_row_per_cycle_from_its_request():
    plant = make_plant()
    plant.advance(5 * CYCLE_NS)
    assert plant.take_truth().t_ns == []
    plant.start_truth()
    plant.advance(8 * CYCLE_NS)
    truth = plant.take_truth()
    assert truth.t_ns == [6 * CYCLE_NS, 7 * CYCLE_NS, 8 * CYCLE_NS]
    assert truth.table()[0, :7].tolist() == plant.q.tolist()
    assert truth.table()[0, 7:10] == pytest.approx(sole(plant), abs=1e-12)


def test_smaller_steps_give_the_same_motion():
    ends = []
    for substeps in (4, 16):
        plant = make_plant(height=0.15, substeps=substeps)
        release(plant)
        plant.hand.let_go()
        send(plant, np.zeros(7))
        plant.advance(S // 10)
        ends.append(plant.q)
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)


def test_integration_uses_the_new_velocity_and_keeps_old_arrays():
    q, qdd, dt = np.linspace(0.0, 1.0, 7), np.linspace(3.0, -3.0, 7), 0.0005
    joints = JointState(q, dt)
    before = joints.rows[0]
    joints.step(qdd)
    now = joints.step(qdd)
    # semi-implicit Euler from rest: dt^2 qdd (1 + 2) after two steps
    assert now[0] == pytest.approx(q + 3.0 * dt * dt * qdd, rel=1e-14)
    assert now[1] == pytest.approx(2.0 * dt * qdd, rel=1e-14)
    assert now[2] == pytest.approx(2.5 * dt * qdd, rel=1e-14)  # where positions are
    assert before.tolist() == q.tolist()


def test_a_driven_joint_keeps_its_velocity_and_a_resting_one_stops():
    joints = JointState(np.zeros(7), 0.001)
    rate = joints.step(np.ones(7))[1]
    joints.move(np.full(7, 0.5))
    assert joints.rows[0].tolist() == [0.5] * 7
    assert joints.rows[1].tolist() == rate.tolist()
    joints.rest(joints.rows[0])
    assert joints.step(np.zeros(7))[0].tolist() == [0.5] * 7


def test_reading_the_sensor_within_a_cycle_does_not_advance_the_arm():
    plant = make_plant()
    release(plant)
    plant.sensor_load(CYCLE_NS + CYCLE_NS // 2)
    assert plant.t_ns == CYCLE_NS  # the load is that of the cycle that has ended


def test_loads_on_foot_hand_and_joints_add_up():
    rng = np.random.default_rng(1)
    j2mp = rng.standard_normal((7, 7))
    loads = JointLoads(j2mp)
    loads.A[:12] = rows = rng.standard_normal((12, 7))
    wrench, motors, driving = (rng.standard_normal(n) for n in (12, 7, 7))
    found = loads.torques(wrench, motors, driving)
    assert found == pytest.approx(rows.T @ wrench + j2mp.T @ motors + driving)


@pytest.mark.parametrize(("away", "times"), [(0.5, 1), (0.02, 5)])
def test_resistance_near_a_stop_is_updated_every_substep(monkeypatch, away, times):
    plant = make_plant()
    plant.q[6] = CONSTANTS.q_upper[6] - away
    release(plant)
    taken, at = [], JointStops.at

    def noted(stops, *state):
        taken.append(0)
        return at(stops, *state)

    monkeypatch.setattr(JointStops, "at", noted)
    plant.advance(plant.t_ns + CYCLE_NS)
    assert len(taken) == times  # at the beginning of the cycle, and in four substeps


def test_releasing_an_arm_within_a_cycle_enables_its_drives_at_once():
    turned = []
    for held_ns in (0, CYCLE_NS // 2):
        plant = make_plant()
        plant.hand.let_go()
        plant.advance(plant.t_ns + held_ns)
        release(plant)
        plant.advance(plant.t_ns + CYCLE_NS // 4)
        turned.append(plant.qd.copy())
    # without its drives' inertia joint 7 would start several times as fast
    assert turned[1] == pytest.approx(turned[0], rel=1e-6)
