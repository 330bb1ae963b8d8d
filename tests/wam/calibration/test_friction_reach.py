"""Which loads dry friction leaves: statics of a foot on the ground."""

from dataclasses import replace

import numpy as np
import pytest

from tests.wam.model.test_friction import example
from wam.calibration.friction_fit import FrictionFit
from wam.calibration.friction_reach import (
    FrictionReach,
    FrictionTorques,
    friction_reach,
    poses_along,
    reaches_along,
    remaining_friction,
    rendered_masses,
)
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, load_constants
from wam.model.friction import motor_shares

CONSTANTS = load_constants()
START = np.array([0.0, 0.7696, 0.0, 1.1857, 0.0, 1.1863, 0.0])  # of terrain S0
LEVEL = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
TRAVEL = 0.45  # m
OTHER_ARM = motor_shares(CONSTANTS, CONSTANTS.coulomb, 1)
BREAKAWAY = 1.2


@pytest.fixture(scope="module")
def model(example_tool):
    return ArmModel(CONSTANTS, example_tool)


def torques(share=1.0, breakaway=BREAKAWAY):
    return FrictionTorques(share * breakaway * OTHER_ARM, share * OTHER_ARM)


def fit(**changes):
    shown = replace(example(), asymmetry=np.zeros(7))
    fields = {
        "friction": shown,
        "deviation": 0.05 * shown.coulomb,
        "asymmetry_deviation": np.zeros(7),
        "residual": np.full(7, 0.02),
        "rows": (100,) * 7,
    }
    return FrictionFit(**{**fields, **changes})


@pytest.mark.parametrize(("index", "rest"), [(0, 5.7), (-1, 12.1)])
def test_the_arm_that_was_identified_leaves_the_load_this_open(model, index, rest):
    reach = reaches_along(model, START, LEVEL, TRAVEL, torques())[index]
    assert reach.rest == pytest.approx(rest, abs=0.2)


def test_sliding_asks_for_twelve_newtons_more_at_the_far_end(model):
    reach = friction_reach(model, START, LEVEL, torques())
    assert reach.push == pytest.approx(12.3, abs=0.2)
    assert abs(reach.shift) == pytest.approx(2.1, abs=0.1)


def wrench_of(model, q, f):
    """Return force and moment at the sole that balance motor torques `f`, (6,)."""
    joints = CONSTANTS.j2mp.T @ f
    J = model.sole_jacobian(q)
    wrench = np.linalg.lstsq(J.T, joints)[0]
    assert J.T @ wrench == pytest.approx(joints, abs=1e-6)
    return wrench


@pytest.mark.parametrize("end", [0, -1])
def test_the_widest_load_balances_friction_that_is_full_in_every_motor(model, end):
    q = poses_along(model, START, LEVEL[0], TRAVEL)[end]
    up = np.linalg.pinv(model.sole_jacobian(q))[:, 2]
    full = torques().at_rest * np.sign(np.round(CONSTANTS.j2mp @ up, 9))
    reach = friction_reach(model, q, LEVEL, torques())
    assert wrench_of(model, q, full)[2] == pytest.approx(reach.rest, rel=1e-6)


def test_a_sliding_foot_bears_what_balances_friction_against_its_way(model):
    q = poses_along(model, START, LEVEL[0], TRAVEL)[20]
    along = np.linalg.pinv(model.sole_jacobian(q))[:, :3] @ LEVEL[0]
    against = torques().sliding * np.sign(np.round(CONSTANTS.j2mp @ along, 9))
    reach = friction_reach(model, q, LEVEL, torques())
    wrench = wrench_of(model, q, against)
    assert wrench[2] == pytest.approx(reach.shift, abs=1e-6)
    assert LEVEL[0] @ wrench[:3] == pytest.approx(reach.push, rel=1e-6)


def test_the_foot_goes_along_the_ground_without_turning(model):
    poses = poses_along(model, START, LEVEL[0], TRAVEL)
    soles = [model.sole_pose(q) for q in poses]
    start, turn = soles[0]
    ways = np.array([position - start for position, _ in soles])
    assert ways[-1] == pytest.approx(TRAVEL * LEVEL[0], abs=1e-6)
    assert np.abs(ways @ LEVEL[1:].T).max() < 1e-6
    assert max(np.abs(turned - turn).max() for _, turned in soles) < 1e-6


def test_half_of_the_friction_leaves_half_as_much_open(model):
    whole, half = (friction_reach(model, START, LEVEL, torques(s)) for s in (1.0, 0.5))
    assert half.rest == pytest.approx(0.5 * whole.rest)
    assert half.push == pytest.approx(0.5 * whole.push)


def test_a_compensation_takes_off_what_surely_rubs():
    sure = fit().lower_bound
    none, most = (remaining_friction(fit(), share) for share in (0.0, 0.8))
    assert none.at_rest - most.at_rest == pytest.approx(0.8 * sure)
    assert none.sliding - most.sliding == pytest.approx(0.8 * sure)


def test_a_friction_that_is_less_well_known_leaves_more():
    doubtful = fit(deviation=0.2 * example().coulomb)
    for share in (0.0, 0.8):
        less, more = (remaining_friction(each, share) for each in (fit(), doubtful))
        assert (more.at_rest > less.at_rest).all()


def test_masses_follow_from_the_worst_place():
    reaches = [FrictionReach(rest, 0.0, 0.0) for rest in (1.0, 2.0, 1.5)]
    masses = rendered_masses(reaches)
    assert masses.down == pytest.approx(2.0 / GRAVITY)
    assert masses.half == pytest.approx(2.0 * masses.down)
    assert masses.tenth == pytest.approx(10.0 * masses.down)


def test_a_slope_takes_a_heavier_mass():
    reaches = [FrictionReach(2.0, 0.0, 0.0)]
    steep = rendered_masses(reaches, np.radians(60.0))
    assert steep.down == pytest.approx(2.0 * rendered_masses(reaches).down)
