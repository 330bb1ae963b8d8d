"""Friction of the simulated motors holds, breaks away and adds no energy."""

import numpy as np
import pytest

from fakes.plant.friction import (
    ASSUMED,
    FRICTION_TABLE,
    BristleFriction,
    draw_friction,
)
from fakes.plant.model import Support
from tests.fakes.scenes import (
    CONSTANTS,
    CYCLE_NS,
    MODEL,
    make_plant,
    release,
    send,
)
from tests.sweeps import swept
from wam.model.arm_model import drive_inertia_matrix
from wam.model.friction import joint_coulomb, largest_motor_ratios

DT = 0.0005
INERTIA = np.array(CONSTANTS.drive_inertia)
TURNS = largest_motor_ratios(CONSTANTS)


class Motors:
    """Seven motors without links: torque, friction, speed."""

    def __init__(self, friction, dt=DT):
        self.friction, self.dt = friction, dt
        self.bristles = BristleFriction(friction, INERTIA, dt)
        self.angle, self.speed = np.zeros(7), np.zeros(7)
        self.work = 0.0  # done against friction [J]

    def step(self, tau):
        bristles, speeds = self.bristles, self.speed.tolist()
        if np.abs(self.speed).max() > 0.05:  # rad/s of a motor: the ripple changes
            bristles.update_load(self.angle.tolist(), [0.0] * 7)
        bristles.take(speeds)
        damping = INERTIA + self.dt * np.array(bristles.damping)
        faster = self.dt * (tau + np.array(bristles.torques(speeds))) / damping
        against = tau - INERTIA * faster / self.dt
        self.speed = self.speed + faster
        self.angle = self.angle + self.dt * self.speed
        bristles.follow(self.speed.tolist())
        self.work += self.dt * float(against @ self.speed)


def nominal(share=1.0):
    return draw_friction(CONSTANTS, share, None, np.zeros(7))


def drawn(seed, share=1.0):
    return draw_friction(CONSTANTS, share, seed, np.zeros(7))


def stored(friction):
    """Return the largest energy that bent bristles hold [J]."""
    return float(friction.coulomb @ (0.5 * friction.breakaway * friction.presliding))


def test_every_parameter_is_measured_or_marked_as_assumed():
    for row in FRICTION_TABLE:
        assert row.low <= row.nominal <= row.high or row.name == "load"
        assert row.low < row.high
        assert row.source == ASSUMED or "OWD" in row.source
    measured = {row.name for row in FRICTION_TABLE if row.source != ASSUMED}
    assert measured == {"coulomb", "viscous"}


def test_drawn_parameters_lie_within_the_table_and_are_those_of_the_seed():
    rows = {row.name: row for row in FRICTION_TABLE}
    for seed in range(20):
        friction = drawn(seed)
        share = friction.coulomb / nominal().coulomb
        assert (share >= rows["coulomb"].low).all()
        assert (share <= rows["coulomb"].high).all()
        assert (friction.breakaway >= rows["breakaway"].low).all()
        assert (friction.load <= rows["load"].high).all()
        assert (drawn(seed).ripple_sin == friction.ripple_sin).all()
        assert (drawn(seed + 1).coulomb != friction.coulomb).all()


def test_an_arm_is_reproducible_by_seed():
    frictions = []
    for seed in (1, 1, 2):
        frictions.append(make_plant(friction=1.0, seed=seed).friction.coulomb.tolist())
    assert frictions[0] == frictions[1] != frictions[2]


def test_friction_under_the_weight_of_the_arm_has_the_stated_share():
    plant = make_plant(friction=1.0, seed=3)
    weight = np.linalg.solve(CONSTANTS.j2mp.T, MODEL.gravity(plant.q))
    # the simulated arm carries the person's forearm, too
    assert plant.friction.load_at[1:4] == pytest.approx(np.abs(weight[1:4]), rel=0.5)
    assert plant.friction.load_at[1] > 0.1


def test_a_single_turning_joint_has_the_stated_friction():
    wanted = 0.4 * CONSTANTS.coulomb
    # a differential has one figure for both of its joints: 2.5 and 1.5 agree to 1 %
    found = joint_coulomb(CONSTANTS, nominal(0.4).coulomb)
    assert found == pytest.approx(wanted, rel=0.01)


MINUTE = 120_000  # steps
CREEP = 50e-6 / 0.7  # rad of a joint 0.7 m from the sole


def crept(load, tremor):
    """Return the creep of joints in a minute [rad]; shares of Coulomb friction."""
    motors = Motors(nominal())
    dry = motors.friction.coulomb
    for k in range(MINUTE):
        motors.step(dry * (load + tremor * np.sin(2.0 * np.pi * 9.5 * k * DT)))
        if k == MINUTE // 30:
            early = motors.angle
    return np.abs((motors.angle - early) / TURNS)


@pytest.mark.slow
def test_a_constant_load_below_breakaway_moves_no_joint():
    assert crept(0.8, 0.0).max() < 2e-6


@pytest.mark.slow
def test_a_load_with_tremor_moves_no_joint():
    assert crept(0.6, 0.25)[:4].max() < CREEP


@pytest.mark.parametrize("dt", [0.0005, 0.002])
@pytest.mark.parametrize("seed", swept([1, 2], {1}))
def test_bristles_return_no_more_energy_than_stored(seed, dt):
    friction = drawn(seed)
    motors, rng = Motors(friction, dt), np.random.default_rng(seed)
    tau, least = np.zeros(7), 0.0
    for _ in range(20_000):
        tau = 0.95 * tau + 0.8 * friction.coulomb * rng.standard_normal(7)
        motors.step(tau)
        least = min(least, motors.work)
    assert np.abs(motors.angle).max() > 1.0  # the motors turned
    assert least >= -0.1 * stored(friction)
    assert motors.work > 10.0 * stored(friction)


def test_light_motors_come_to_rest_with_steps_of_a_whole_cycle():
    motors = Motors(nominal(), dt=0.002)
    motors.speed = 2.0 * TURNS
    for _ in range(2_000):
        motors.step(np.zeros(7))
    assert np.abs(motors.speed / TURNS).max() < 1e-6


@pytest.mark.slow
# 1 N m/s is twice to ten times the break-away of a wrist joint in a second.
@pytest.mark.parametrize(("rate", "motors"), [(0.1, 7), (1.0, 4)])
def test_breakaway_torque_does_not_depend_on_the_rate(rate, motors):
    """`rate`: of the torque at its joint [N m/s]."""
    friction = drawn(3)
    bench = Motors(friction)
    held = friction.coulomb + friction.asymmetry
    wanted = held * (1.0 + friction.ripple_cos) * friction.breakaway
    broke = np.full(7, np.nan)
    for k in range(-600, round(0.6 * 4.0 / rate / DT)):
        tau = 0.6 * wanted + rate / TURNS * max(k, 0) * DT
        bench.step(np.minimum(tau, 1.2 * wanted))
        is_loose = np.isnan(broke) & (bench.speed > 0.05 * TURNS)
        if k > 0:  # the step to 0.6 has settled
            broke[is_loose] = tau[is_loose]
        if not np.isnan(broke).any():
            break
    assert broke[:motors] == pytest.approx(wanted[:motors], rel=0.06)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_sliding_motor_is_resisted_by_the_steady_torque_of_its_friction(sign):
    friction = drawn(5)
    motors = Motors(friction)
    # a stiff servo keeps the speed; its torque equals the resistance
    speed = sign * 0.1 * TURNS
    found, wanted = [], []
    for k in range(12_000):
        tau = 0.3 * INERTIA / DT * (speed - motors.speed) + motors.friction.steady(
            motors.angle, np.zeros(7), speed
        )
        motors.step(tau)
        if k > 2_000:
            found.append(tau)
            wanted.append(friction.steady(motors.angle, np.zeros(7), motors.speed))
    assert np.mean(found, axis=0) == pytest.approx(np.mean(wanted, axis=0), rel=0.01)


def test_supporting_an_arm_relaxes_its_bristles():
    plant = make_plant(friction=1.0, support=Support.PERSON)
    plant.hand.let_go()
    for _ in range(2):
        release(plant)
        send(plant, MODEL.gravity(plant.q) + 0.9 * CONSTANTS.coulomb)
        plant.advance(plant.t_ns + 50 * CYCLE_NS)
        plant.short_windings([True] * 7)
    before = plant.q.copy()
    release(plant)
    send(plant, MODEL.gravity(plant.q))
    plant.advance(plant.t_ns + 50 * CYCLE_NS)
    # a bent bristle would throw its joint back by most of a milliradian
    assert np.abs(plant.q - before).max() < 5e-5


def test_a_held_arm_does_not_creep_under_half_of_its_friction():
    plant = make_plant(friction=1.0)
    release(plant)
    plant.hand.let_go()
    positions = []
    for k in range(2_000):
        send(plant, MODEL.gravity(plant.q) + 0.5 * CONSTANTS.coulomb)
        plant.advance(plant.t_ns + CYCLE_NS)
        if k % 500 == 499:
            positions.append(plant.q.copy())
    assert np.abs(positions[-1] - positions[0]).max() < 2e-6


def test_one_motor_of_a_differential_sticks_while_the_other_one_slides():
    plant = make_plant(friction=1.0)
    release(plant)
    plant.hand.let_go()
    start = CONSTANTS.j2mp @ plant.q
    push = np.zeros(7)
    push[2] = 1.5 * nominal().breakaway[2] * nominal().coulomb[2]  # at motor 3
    for _ in range(100):
        send(plant, MODEL.gravity(plant.q) + CONSTANTS.j2mp.T @ push)
        plant.advance(plant.t_ns + CYCLE_NS)
    turned = np.abs(CONSTANTS.j2mp @ plant.q - start)
    assert turned[2] > 10.0 * nominal().presliding[2]
    assert turned[1] < nominal().presliding[1]


def test_motors_of_a_differential_are_coupled_in_the_implicit_step():
    """Off-diagonal damping is explicit; steps four times shorter agree."""
    ends = []
    for substeps in (4, 16):
        plant = make_plant(friction=1.0, substeps=substeps)
        release(plant)
        plant.hand.let_go()
        tau = CONSTANTS.j2mp.T @ np.array([0, 0.02, 0.12, 0, 0.01, 0.05, 0])
        for _ in range(100):
            send(plant, MODEL.gravity(plant.q) + tau)
            plant.advance(plant.t_ns + CYCLE_NS)
        ends.append(plant.qd.copy())
    assert np.abs(ends[1][1:6]).max() > 0.1
    assert ends[0] == pytest.approx(ends[1], rel=0.05, abs=0.01)


def test_the_drives_keep_their_inertia_with_friction():
    plant = make_plant(friction=0.0)
    release(plant)
    plant.hand.let_go()
    send(plant, MODEL.gravity(plant.q) + 0.01 * np.eye(7)[6])
    plant.advance(CYCLE_NS)
    wanted = 0.01 / (drive_inertia_matrix(CONSTANTS)[6, 6])
    assert 0.1 * wanted < plant.qd[6] / 0.002 < wanted
