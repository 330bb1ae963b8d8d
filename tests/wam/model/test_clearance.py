"""Distances of the arm to itself, the floor and what stands around it."""

import numpy as np
import pytest

from wam.model.arm_model import ArmModel
from wam.model.clearance import (
    BASE_HEIGHT,
    CLEARANCE_MARGIN,
    STEP,
    ArmClearance,
    ObstacleBox,
    straight_way,
)
from wam.model.constants import load_constants

CONSTANTS = load_constants()
UPRIGHT = np.array([0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0])
COLLIDING = {
    "stretched into the floor": ([0.0, 1.95, 0, 0.6, 0, 0, 0], "the foot", "the floor"),
    "the hand on the shoulder": ([0, 0, 0, 3.0, 0, 1.0, 0], "the foot", "the shoulder"),
    "folded as at home": (CONSTANTS.home, "the wrist", "the upper arm"),
}


@pytest.fixture(scope="module")
def clearance(example_tool):
    return ArmClearance(CONSTANTS, example_tool)


def sphere_at(point, side):
    return ObstacleBox("the post", np.array(point), np.full(3, side), np.eye(3))


@pytest.mark.parametrize("name", COLLIDING)
def test_a_pose_that_collides_is_known_with_its_pair(clearance, name):
    q, *_ = COLLIDING[name]
    assert clearance.nearest(np.array(q, dtype=float)).distance < CLEARANCE_MARGIN


def test_an_upright_arm_is_far_from_everything(clearance):
    assert clearance.nearest(UPRIGHT).distance > 0.1


def test_the_floor_is_as_far_below_the_foot_as_the_kinematics_say(example_tool):
    model = ArmModel(CONSTANTS, example_tool)
    down = np.array([0.0, 1.2, 0.0, 1.2, 0.0, 0.75, 0.0])  # joints add up to pi
    sole = model.sole_pose(down)[0][2]
    height = ArmClearance(CONSTANTS, example_tool, (), sole - 0.2).nearest(down)
    assert {height.first, height.second} == {"the foot", "the floor"}
    assert height.distance == pytest.approx(0.2, abs=0.01)


def test_the_floor_is_what_the_arm_stands_on():
    assert pytest.approx(0.346) == BASE_HEIGHT


def test_an_obstacle_is_where_it_was_put(example_tool):
    model = ArmModel(CONSTANTS, example_tool)
    sole, rotation = model.sole_pose(UPRIGHT)
    beside = sole + 0.2 * rotation[:, 2]  # 200 mm on, half a side nearer
    box = ObstacleBox("the post", beside, np.full(3, 0.1), rotation)
    gap = ArmClearance(CONSTANTS, example_tool, (box,)).nearest(UPRIGHT)
    assert {gap.first, gap.second} == {"the foot", "the post"}
    assert gap.distance == pytest.approx(0.15, abs=0.01)


def test_a_way_through_an_obstacle_is_hit_though_both_ends_are_free(example_tool):
    start, goal = UPRIGHT.copy(), UPRIGHT.copy()
    start[0], goal[0] = -0.8, 0.8
    middle = ArmModel(CONSTANTS, example_tool).sole_pose(UPRIGHT)[0]
    post = sphere_at(middle, 0.05)
    clearance = ArmClearance(CONSTANTS, example_tool, (post,))
    assert clearance.nearest(start).distance > CLEARANCE_MARGIN
    assert clearance.nearest(goal).distance > CLEARANCE_MARGIN
    hit = clearance.first_hit(start, goal)
    assert hit is not None
    assert hit.second == "the post"
    assert clearance.first_hit(start, start) is None


def test_a_thin_post_is_not_stepped_over(example_tool):
    """Whatever a way's length, two looks are at most 20 mrad, 20 mm at 1 m, apart."""
    start, goal = UPRIGHT.copy(), UPRIGHT.copy()
    start[0], goal[0] = -2.5, 2.5
    assert np.abs(np.diff(straight_way(start, goal), axis=0)).max() <= STEP
    middle = ArmModel(CONSTANTS, example_tool).sole_pose(UPRIGHT)[0]
    clearance = ArmClearance(CONSTANTS, example_tool, (sphere_at(middle, 0.002),))
    assert clearance.first_hit(start, goal) is not None


def test_a_foot_in_its_container_may_leave_it_and_go_no_deeper(example_tool):
    model = ArmModel(CONSTANTS, example_tool)
    low = np.array([0.0, 0.7696, 0.0, 1.1857, 0.0, 1.1863, 0.0])
    sole = model.sole_pose(low)[0]
    size = np.array([0.6, 0.6, 0.4])
    center = sole - np.array([0.0, 0.0, 0.17])  # the sole is 30 mm inside
    box = ObstacleBox("the container", center, size, np.eye(3))
    clearance = ArmClearance(CONSTANTS, example_tool, (box,))
    deeper = low.copy()
    deeper[1] += 0.25
    assert clearance.nearest(low).distance < 0.0
    assert clearance.first_hit(low, UPRIGHT) is None
    assert clearance.first_hit(deeper, low) is None  # out of it again
    through = low.copy()
    through[0] = 0.9
    around = low.copy()
    around[0] = -0.9
    assert clearance.first_hit(through, around) is not None


def test_a_gap_is_told_in_words_and_millimetres(clearance):
    text = clearance.nearest(CONSTANTS.home).text()
    assert "mm from" in text
    assert "the wrist" in text
