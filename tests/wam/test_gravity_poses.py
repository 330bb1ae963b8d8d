import numpy as np
import pytest

from wam.constants import load_constants
from wam.first_moments import regressor
from wam.gravity_poses import (
    FOLDED,
    MARGIN,
    OFFSET,
    choose_poses,
    is_clear,
    plan_halts,
    way_seconds,
)
from wam.model import ArmModel

FLOOR = 0.3
START = np.array([0.0, 0.7, 0.0, 1.25, 0.0, 1.15, 0.0])


@pytest.fixture(scope="module")
def model(example_tool):
    return ArmModel(load_constants(), example_tool)


@pytest.fixture(scope="module")
def poses(model):
    return choose_poses(model, 8, FLOOR)


@pytest.fixture(scope="module")
def halts(model, poses):
    return plan_halts(model, START, poses, FLOOR)


def test_eight_poses_show_all_of_gravity_well(model, poses):
    Y = np.vstack([regressor(model.constants, q) for q in poses])
    values = np.linalg.svd(Y, compute_uv=False)
    assert len(poses) == 8
    assert values[11] > 0.03 * values[0]  # twelve directions, none of them faint


def test_the_sole_stays_above_the_floor_in_every_pose_and_on_the_way(model, halts):
    here = START
    for halt in halts[:-1]:  # the last one is where the arm began
        assert model.sole_pose(halt.q)[0][2] > FLOOR - 0.1  # approaches add 0.06 rad
        assert is_clear(model, here, halt.q, FLOOR - 0.1)
        here = halt.q


def test_halts_stay_away_from_the_joint_stops(model, halts):
    for halt in halts[:-1]:
        assert (halt.q >= model.constants.q_lower + MARGIN - 1e-9).all()
        assert (halt.q <= model.constants.q_upper - MARGIN + 1e-9).all()


def test_each_pose_is_approached_once_from_below_and_once_from_above(halts):
    for number in range(8):
        at = [i for i, halt in enumerate(halts) if halt.pose == number]
        assert len(at) == 2
        sides = [halts[i - 1].q - halts[i].q for i in at]
        assert sides[0] == pytest.approx(np.full(7, -OFFSET))
        assert sides[1] == pytest.approx(np.full(7, OFFSET))


def test_the_arm_ends_where_it_began(halts):
    assert (halts[-1].q == START).all()
    assert halts[-2].q.tolist() == list(FOLDED)


def test_the_time_of_the_way_is_that_of_its_moves(halts):
    assert way_seconds(START, halts) == pytest.approx(
        way_seconds(START, halts[:5]) + way_seconds(halts[4].q, halts[5:])
    )
    assert way_seconds(START, halts[:1]) > 0.0
