"""The compiled dynamics beside Pinocchio's, from the same state under the same inputs.

Tolerances: accelerations 1e-10 of the largest; positions 1e-12 rad (m), speeds 1e-10
rad/s and forces 1e-9 N (N m) at the end. The two sum in another order and so differ by
rounding, a thousandth of that. It could grow where one breaks a contact of stones and
the other does so a step later.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin  # noqa: TID253 - the arm is compared with it
import pytest

from fakes.ground.terrain import Container, make_terrain
from fakes.kernels.choice import COMPILED, PINOCCHIO, chosen_dynamics
from fakes.plant.gauges import WristGauges
from fakes.plant.model import PlantOptions, arm_and_hand
from fakes.plant.plant import ArmPlant
from fakes.plant.push import PACES
from tests.fakes.plant.test_plant import Pusher
from tests.fakes.scenes import (
    CONSTANTS,
    CYCLE_NS,
    FRAME,
    MODEL,
    START_Q,
    TOOL,
    release,
    send,
    solve_start,
)
from wam.model.gravity import compensation

if chosen_dynamics() != COMPILED:
    pytest.skip("nothing is compiled here", allow_module_level=True)
from fakes.ground.compiled.grounds import compiled_ground
from fakes.plant.compiled.gauges import CompiledGauges
from fakes.plant.compiled.motion import accelerate, take_links
from fakes.plant.compiled.substeps import BODY

GROUNDS = [None, ("small", "tread"), ("big", "tread"), ("none", "tread")]
GAUGES = (WristGauges, CompiledGauges)
WINDOW = 50  # cycles


def pair(ground=None, **options):
    """Return the same arm twice: in Pinocchio and compiled."""
    q = solve_start(MODEL, FRAME, START_Q, 0.01)
    plants = []
    for dynamics in (PINOCCHIO, COMPILED):
        chosen = replace(PlantOptions(0.02, seed=3, dynamics=dynamics), **options)
        plant = ArmPlant(CONSTANTS, TOOL, FRAME, q, chosen)
        if ground is not None:
            drawn = make_terrain(*ground, FRAME.incline, np.random.default_rng(5))
            terrain = Container(drawn)
            is_compiled = dynamics == COMPILED
            plant.terrain = compiled_ground(terrain) if is_compiled else terrain
        plants.append(plant)
    return plants


def advance(plants, cycles=WINDOW, torque=None):
    """Let time pass; where no `torque` is given the foot weighs 0.3 kg."""
    for cycle in range(cycles):
        tau = compensation(MODEL, plants[0].q, 0.3) if torque is None else torque
        for plant in plants:
            send(plant, tau)
            # As the pucks do it: now and then within a cycle.
            plant.advance(plant.t_ns + (CYCLE_NS // 2 if cycle % 3 else CYCLE_NS))
            plant.advance(-(-plant.t_ns // CYCLE_NS) * CYCLE_NS)


def assert_alike(plants):
    first, second = plants
    assert second.t_ns == first.t_ns
    assert second.q == pytest.approx(first.q, abs=1e-12)
    assert second.qd == pytest.approx(first.qd, abs=1e-10)
    assert second.contact_force == pytest.approx(first.contact_force, abs=1e-9)
    loads = [plant.sensor_load(plant.t_ns) for plant in plants]
    assert loads[1] == pytest.approx(loads[0], abs=1e-9)
    assert second.sole_x == pytest.approx(first.sole_x, abs=1e-12)
    assert second.counts() == pytest.approx(first.counts(), abs=1)


@pytest.mark.parametrize("seed", range(20))
def test_joints_accelerate_as_in_pinocchio(seed):
    rng = np.random.default_rng(seed)
    frame = replace(FRAME, incline=rng.uniform(-0.3, 0.3), heading=rng.uniform(-1, 1))
    parts = arm_and_hand(CONSTANTS, TOOL, frame)
    q, qd = rng.uniform(-2.0, 2.0, 7), rng.uniform(-5.0, 5.0, 7)
    tau, armature = rng.uniform(-20.0, 20.0, 7), rng.uniform(0.0, 0.1, 7)
    record = np.zeros(1, BODY)[0]
    take_links(record, parts)
    record["torques"], record["armature"] = tau, armature
    accelerate(record, q, qd)
    model = parts[0]
    model.armature = armature
    wanted = pin.aba(model, model.createData(), q, qd, tau)
    assert record["qdd"] == pytest.approx(wanted, abs=1e-10 * np.abs(wanted).max())


@pytest.mark.parametrize("ground", GROUNDS)
def test_an_arm_that_is_put_down_and_pushed_goes_on_alike(ground):
    plants = pair(ground)
    for plant in plants:
        release(plant)
        plant.hand.put_down(0.0)
        plant.start_truth()
    advance(plants, 600)
    for plant in plants:
        plant.hand.push(PACES["fast"], np.random.default_rng(7))
    advance(plants, 1400)
    assert_alike(plants)
    one, other = (plant.take_truth() for plant in plants)
    assert other.t_ns == one.t_ns
    F_n = one.table()[:, 15]
    assert ground is None or (F_n > 0.1).mean() > 0.5
    assert other.table() == pytest.approx(one.table(), abs=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.02, 1.0])
@pytest.mark.parametrize("substeps", [1, 4, 16])
def test_a_fast_fall_goes_on_alike(friction, substeps):
    plants = pair(friction=friction, substeps=substeps)
    for plant in plants:
        release(plant)
        plant.hand.let_go()
        plant.qd[:] = [1.0, -2.0, 3.0, 2.0, -3.0, 2.0, 4.0]
    advance(plants, torque=np.zeros(7))
    assert np.abs(plants[0].qd).max() > 0.5 or friction == 1.0
    assert_alike(plants)


@pytest.mark.parametrize("joint", range(7))
def test_joints_meet_their_stops_alike(joint):
    plants = pair(has_hand=False)
    for plant in plants:
        plant.q[joint] = CONSTANTS.q_upper[joint] - 0.01
        release(plant)
        plant.qd[joint] = 2.0
    advance(plants, 10)
    assert np.any(plants[0].q > CONSTANTS.q_upper - 0.05)
    assert_alike(plants)


def test_a_hand_carries_the_arm_alike():
    plants = pair(("small", "tread"))
    for plant in plants:
        release(plant)
        plant.hand.lift_to_start()
    advance(plants, 150)
    assert plants[0].foot_speed > 0.01
    assert_alike(plants)


def test_brakes_hold_and_let_go_alike_and_a_moved_arm_goes_on_from_there():
    plants = pair(("small", "tread"))
    advance(plants, 3)
    for plant in plants:
        release(plant)
    advance(plants, 20)
    for plant in plants:
        plant.set_braking(is_braked=True, is_powered=True)
    advance(plants, 3)
    assert plants[0].is_held
    assert not plants[1].qd.any()
    assert_alike(plants)
    moved = plants[0].q + 0.01
    for plant in plants:
        plant.q = moved
        plant.set_braking(is_braked=True, is_powered=False)
    advance(plants, 20, torque=np.zeros(7))
    assert_alike(plants)


def test_a_disturbance_and_a_finger_act_alike():
    plants = pair()
    for plant in plants:
        release(plant)
        plant.disturbance[6] = 0.4
        plant.finger = (0.5, 0.0, 3.0)
    advance(plants, 20)
    assert abs(plants[0].qd[6]) > 0.01
    assert_alike(plants)


def test_gauges_feel_alike_whatever_foot_and_ground_do():
    rng = np.random.default_rng(4)
    tool = replace(TOOL, sole=np.array([0.02, -0.01, 0.1]))
    gauges = [kind(tool, FRAME.axes()[:, 2], 0.002) for kind in GAUGES]
    for _ in range(50):
        rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        ground, rates = rng.uniform(-20, 20, 6), rng.uniform(-1, 1, 6)
        for one in gauges:
            one.end_cycle(rotation, ground.tolist(), rates.tolist())
        loads = [one.load() for one in gauges]
        assert loads[1] == pytest.approx(loads[0], abs=1e-9)


def test_a_ground_that_only_python_knows_pushes_alike():
    plants = pair()
    for plant in plants:
        release(plant)
        plant.terrain = Pusher((1.0, 0.5, 2.0, 0.01, 0.02, 0.03))
    advance(plants, 20)
    assert plants[1].contact_force == pytest.approx((-1.0, 0.5, 2.0))
    assert_alike(plants)


def test_arrays_that_were_taken_stay_as_they_were():
    plant = pair()[1]
    release(plant)
    before, copy = plant.q, plant.q.copy()
    plant.advance(CYCLE_NS)
    assert before.tolist() == copy.tolist() != plant.q.tolist()


def test_an_arm_on_cables_has_no_compiled_dynamics():
    options = PlantOptions(cables=12.0, dynamics=COMPILED)
    plant = ArmPlant(CONSTANTS, TOOL, FRAME, START_Q, options)
    assert plant.dynamics == PINOCCHIO
