"""Motors that turn the joints through elastic cables."""

from dataclasses import replace

import numpy as np
import pytest

from fakes.plant.friction import draw_friction
from fakes.plant.model import PlantOptions, arm_and_hand, cable_inertia
from fakes.plant.plant import ArmPlant
from tests.fakes.scenes import (
    CONSTANTS,
    CYCLE_NS,
    FRAME,
    MODEL,
    START_Q,
    TOOL,
    float_for,
    release,
    send,
)

SLIPPERY = draw_friction(CONSTANTS, 0.0, None, np.zeros(7))
STUCK = replace(SLIPPERY, coulomb=np.full(7, 1e4), presliding=np.full(7, 1e-4))


def free_arm(cables, motors):
    """Return a released, unsupported arm without ground."""
    options = PlantOptions(cables=cables, motors=motors, has_hand=False)
    plant = ArmPlant(CONSTANTS, TOOL, FRAME, START_Q, options)
    release(plant)
    return plant


def angles(plant):
    """Return the motor angles by the encoders [rad of the joints]."""
    motor = np.array(plant.counts()) * 2.0 * np.pi / np.array(CONSTANTS.cts)
    return np.linalg.solve(CONSTANTS.j2mp, motor)


def moved(cables, seconds=0.3):
    """Return the motion of an arm with `cables` pushed with 4 N m at joint 4."""
    plant = free_arm(cables, SLIPPERY)
    plant.disturbance[3] = 4.0
    list(float_for(plant, seconds))
    return plant.q - START_Q


def test_stiff_cables_act_like_rigid_ones():
    stiff, rigid = moved(40.0), moved(None)
    assert np.abs(rigid).max() > 0.1
    assert np.abs(stiff - rigid).max() < 0.02 * np.abs(rigid).max()


@pytest.mark.slow
@pytest.mark.parametrize("resonance", [8.0, 20.0])
def test_the_arm_swings_in_the_modes_of_its_cables(resonance):
    import pinocchio as pin
    from scipy.linalg import eigh

    model, _, _ = arm_and_hand(CONSTANTS, TOOL, FRAME, forearm=0.0)
    swinging = cable_inertia(model, CONSTANTS, START_Q)
    springs = np.diag((2.0 * np.pi * resonance) ** 2 * swinging)
    mass = np.array(pin.crba(model, model.createData(), START_Q))
    stiffness = CONSTANTS.j2mp.T @ springs @ CONSTANTS.j2mp
    rates, modes = eigh(stiffness, np.triu(mass) + np.triu(mass, 1).T)
    plant = free_arm(resonance, STUCK)
    list(float_for(plant, 1.0))
    plant.qd[:] = 0.02 * modes[:, 0] / np.abs(modes[:, 0]).max()
    largest = int(np.argmax(np.abs(modes[:, 0])))
    speeds = [plant.qd[largest] for _ in float_for(plant, 0.6)]
    ups = np.flatnonzero(np.diff(np.sign(speeds)) > 0)
    seen = 1.0 / (np.diff(ups).mean() * CYCLE_NS * 1e-9)
    assert seen == pytest.approx(np.sqrt(rates[0]) / (2.0 * np.pi), rel=0.03)
    assert seen < resonance


@pytest.mark.parametrize("resonance", [0.0, 41.0])
def test_implausible_cables_are_refused(resonance):
    with pytest.raises(ValueError, match="resonance"):
        free_arm(resonance, STUCK)


@pytest.mark.slow
def test_encoders_follow_the_motors_and_joints_sag_below_them():
    plant = free_arm(8.0, STUCK)
    before = angles(plant)
    for _ in range(1000):
        send(plant, np.zeros(7))  # the motors stick, the cables carry the arm
        plant.advance(plant.t_ns + CYCLE_NS)
    sagged = plant.q - START_Q
    assert np.abs(angles(plant) - before).max() < 5e-4
    gravity = MODEL.gravity(plant.q)
    assert np.abs(sagged[1]) > 1e-3
    assert sagged[1] * gravity[1] < 0.0


@pytest.mark.slow
def test_an_undriven_arm_on_cables_gains_no_energy():
    plant = free_arm(15.0, draw_friction(CONSTANTS, 0.4, 3, np.zeros(7)))
    plant.qd[:] = 0.3
    speeds = [np.abs(plant.qd).max() for _ in float_for(plant, 1.5)]
    assert max(speeds[-100:]) < 0.05 * max(speeds[:100])


def test_brakes_relax_the_cables():
    plant = free_arm(8.0, STUCK)
    list(float_for(plant, 0.5))
    before = plant.q.copy()
    plant.short_windings([True] * 7)
    plant.advance(plant.t_ns + CYCLE_NS)
    assert np.abs(angles(plant) - before).max() < 5e-4
