"""Distances of the arm to itself, to the floor and to obstacles."""

import numpy as np
import pytest

from wam.model.arm_model import ArmModel
from wam.model.clearance import (
    CLEARANCE_MARGIN,
    STEP,
    ArmClearance,
    ObstacleBox,
    straight_path,
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
def test_a_colliding_pose_is_within_the_margin(clearance, name):
    q, *_ = COLLIDING[name]
    assert clearance.nearest(np.array(q, dtype=float)).distance < CLEARANCE_MARGIN


def test_an_upright_arm_is_far_from_everything(clearance):
    assert clearance.nearest(UPRIGHT).distance > 0.1


def test_floor_clearance_of_the_foot_agrees_with_the_kinematics(example_tool):
    model = ArmModel(CONSTANTS, example_tool)
    down = np.array([0.0, 1.2, 0.0, 1.2, 0.0, 0.75, 0.0])  # joints add up to pi
    sole = model.sole_pose(down)[0][2]
    height = ArmClearance(CONSTANTS, example_tool, (), sole - 0.2).nearest(down)
    assert {height.first, height.second} == {"the foot", "the floor"}
    assert height.distance == pytest.approx(0.2, abs=0.01)


def test_an_obstacle_is_at_its_stated_location(example_tool):
    model = ArmModel(CONSTANTS, example_tool)
    sole, rotation = model.sole_pose(UPRIGHT)
    center = sole + 0.2 * rotation[:, 2]  # 200 mm away, its face 150 mm
    box = ObstacleBox("the post", center, np.full(3, 0.1), rotation)
    gap = ArmClearance(CONSTANTS, example_tool, (box,)).nearest(UPRIGHT)
    assert {gap.first, gap.second} == {"the foot", "the post"}
    assert gap.distance == pytest.approx(0.15, abs=0.01)


def test_a_path_through_an_obstacle_collides_though_both_ends_are_free(example_tool):
    start, goal = UPRIGHT.copy(), UPRIGHT.copy()
    start[0], goal[0] = -0.8, 0.8
    middle = ArmModel(CONSTANTS, example_tool).sole_pose(UPRIGHT)[0]
    post = sphere_at(middle, 0.05)
    clearance = ArmClearance(CONSTANTS, example_tool, (post,))
    assert clearance.nearest(start).distance > CLEARANCE_MARGIN
    assert clearance.nearest(goal).distance > CLEARANCE_MARGIN
    hit = clearance.first_collision(start, goal)
    assert hit is not None
    assert hit.second == "the post"
    assert 0.0 < hit.distance < CLEARANCE_MARGIN
    assert clearance.first_collision(start, start) is None


def test_a_thin_post_is_not_missed(example_tool):
    """Checked poses of any path are at most 20 mrad, 20 mm at 1 m, apart."""
    start, goal = UPRIGHT.copy(), UPRIGHT.copy()
    start[0], goal[0] = -2.5, 2.5
    assert np.abs(np.diff(straight_path(start, goal), axis=0)).max() <= STEP
    middle = ArmModel(CONSTANTS, example_tool).sole_pose(UPRIGHT)[0]
    clearance = ArmClearance(CONSTANTS, example_tool, (sphere_at(middle, 0.002),))
    assert clearance.first_collision(start, goal) is not None


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
    assert clearance.first_collision(low, UPRIGHT) is None
    assert clearance.first_collision(deeper, low) is None  # out of it again
    through = low.copy()
    through[0] = 0.9
    around = low.copy()
    around[0] = -0.9
    assert clearance.first_collision(through, around) is not None


def test_a_clearance_is_described_in_millimetres(clearance):
    text = clearance.nearest(CONSTANTS.home).text()
    assert "mm from" in text
    assert "the wrist" in text


def frames(q):
    """Return (rotation, origin) of the frame of each joint, from the DH table."""
    rotation, origin = np.eye(3), np.zeros(3)
    result = [(rotation, origin)]
    for joint, angle in enumerate(q):
        c, s = np.cos(angle), np.sin(angle)
        rotation = rotation @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        result.append((rotation, origin))
        origin = origin + rotation @ [CONSTANTS.a[joint], 0.0, CONSTANTS.d[joint]]
        c, s = np.cos(CONSTANTS.alpha[joint]), np.sin(CONSTANTS.alpha[joint])
        rotation = rotation @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return result


def enclosing(tool):
    """Return (joint, radius, lowest, highest along its z, x, y) of every body [m]."""
    x, y, z = tool.sole
    return {
        "the base": (0, 0.12, -0.346, -0.10, 0.0, 0.0),
        "the shoulder": (1, 0.15, -0.15, 0.15, 0.0, 0.0),
        "the upper arm": (3, 0.08, 0.08, 0.55, 0.0, 0.0),
        "the elbow": (4, 0.09, -0.09, 0.09, 0.0, 0.0),
        "the forearm": (5, 0.065, 0.0, 0.30, 0.0, 0.0),
        "the wrist": (6, 0.065, -0.065, 0.065, 0.0, 0.0),
        "the foot": (7, 0.045, 0.0, 0.0609 + z, x, y),
    }


def axis_points(body, frames):
    """Return points on the axis of a capsule, close to each other, base frame."""
    joint, radius, low, high, x, y = body
    rotation, origin = frames[joint]
    low, high = sorted((low + radius, high - radius))
    along = np.linspace(low, high, 200)
    flat = np.ones_like(along)
    return origin + np.stack([x * flat, y * flat, along], axis=-1) @ rotation.T


PAIRS = [
    ("the elbow", "the base"),
    ("the forearm", "the base"),
    ("the wrist", "the base"),
    ("the foot", "the base"),
    ("the forearm", "the shoulder"),
    ("the wrist", "the shoulder"),
    ("the foot", "the shoulder"),
    ("the wrist", "the upper arm"),
    ("the foot", "the upper arm"),
]
ON_FLOOR = ("the upper arm", "the elbow", "the forearm", "the wrist", "the foot")


def test_every_body_encloses_the_measured_arm(example_tool, clearance):
    """Distances of all pairs agree with those derived here from the DH table."""
    rng = np.random.default_rng(3)
    bodies = enclosing(example_tool)
    for q in rng.uniform(CONSTANTS.q_lower, CONSTANTS.q_upper, (8, 7)):
        at = frames(q)
        points = {name: axis_points(body, at) for name, body in bodies.items()}
        expected = [
            np.linalg.norm(points[a][:, None] - points[b], axis=-1).min()
            - bodies[a][1]
            - bodies[b][1]
            for a, b in PAIRS
        ]
        expected += [points[a][:, 2].min() - bodies[a][1] + 0.346 for a in ON_FLOOR]
        found, wanted = clearance.distances(q), np.array(expected)
        apart = wanted > 0.0
        assert found[apart] == pytest.approx(wanted[apart], abs=5e-4)
        assert (found[~apart] < 1e-3).all()


def test_a_path_is_checked_end_to_end_in_equal_steps():
    start, goal = UPRIGHT, UPRIGHT + np.array([0.05, -0.1, 0, 0, 0, 0, 0])
    path = straight_path(start, goal)
    assert path[0] == pytest.approx(start)
    assert path[-1] == pytest.approx(goal)
    assert np.diff(path, axis=0) == pytest.approx(
        np.tile((goal - start) / (len(path) - 1), (len(path) - 1, 1))
    )
    assert len(path) in (6, 7)
    assert len(straight_path(start, start)) == 2
    assert len(straight_path(start, start + 0.999 * STEP)) == 2


class GivenGaps(ArmClearance):
    """A clearance with given gaps at the steps of joint 1 from 0 to 1 rad."""

    def __init__(self, tool, gaps):
        super().__init__(CONSTANTS, tool)
        self.gaps = gaps

    def distances(self, q):
        count = len(straight_path(np.zeros(7), np.eye(7)[0]))
        return np.array([self.gaps.get(round(q[0] * (count - 1)), 0.5)])


LAST = len(straight_path(np.zeros(7), np.eye(7)[0])) - 1


@pytest.mark.parametrize(
    ("gaps", "is_hit"),
    [
        ({}, False),
        ({1: 0.029}, True),
        ({LAST - 1: 0.029}, True),
        ({LAST // 2: 0.031}, False),
        ({0: 0.01, 1: 0.0081}, False),
        ({0: 0.01, 1: 0.0079}, True),
        ({LAST: 0.01, LAST - 1: 0.0081}, False),
        ({LAST: 0.01, 7: 0.0079}, True),
    ],
)
def test_a_clear_path_comes_no_closer_than_the_margin_or_its_ends(
    example_tool, gaps, is_hit
):
    hit = GivenGaps(example_tool, gaps).first_collision(np.zeros(7), np.eye(7)[0])
    assert (hit is not None) is is_hit
