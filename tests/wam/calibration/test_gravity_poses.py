from itertools import pairwise
from typing import ClassVar

import numpy as np
import pytest

from acquisition.errors import SettingsError
from wam.calibration import free_space
from wam.calibration.free_space import (
    OFFSET,
    UPRIGHT,
    FreeSpace,
    check_poses,
    elbow_position,
    is_clear,
    lowest_height,
)
from wam.calibration.poses import (
    APPROACH_SPEED,
    MARGIN,
    POINT_SPEED,
    REACH,
    choose_orientations,
    choose_poses,
    leg_speed,
    plan_waypoints,
    tilted_pair,
    travel_time,
)
from wam.control.position_control import JointMove
from wam.model.arm_model import ArmModel
from wam.model.clearance import BodyGap
from wam.model.constants import load_constants
from wam.model.moments import regressor

FLOOR = 0.33
SPACE = FreeSpace(FLOOR)
TWISTED = (0.0, 1.0, -1.1, 2.9, -4.3, -1.2, 0.6)  # to rise it goes down first
IN_CONTAINER = np.array([0.0, 0.7, 0.0, 1.25, 0.0, 1.15, 0.0])


@pytest.fixture(scope="module")
def model(example_tool):
    return ArmModel(load_constants(), example_tool)


@pytest.fixture(scope="module")
def poses(model):
    return choose_poses(model, 12, SPACE)


@pytest.fixture(scope="module")
def halts(model, poses):
    return plan_waypoints(model, IN_CONTAINER, poses, SPACE)


@pytest.mark.parametrize("count", [4, 12])
def test_the_poses_condition_all_gravity_parameters_well(model, count):
    poses = choose_poses(model, count, SPACE)
    Y = np.vstack([regressor(model.constants, q) for q in poses])
    values = np.linalg.svd(Y, compute_uv=False)
    assert len(poses) == count
    assert values[0] < 10.0 * values[11]  # twelve directions, none of them weak


def test_the_arm_stays_above_the_floor_once_it_has_risen(model, halts):
    for here, halt in pairwise(halts[:-1]):
        path = here.q + np.linspace(0, 1, 50)[:, None] * (halt.q - here.q)
        assert lowest_height(model, path).min() > FLOOR - 0.003


def test_paths_from_and_to_the_container_stay_above_the_starting_height(model, halts):
    start = lowest_height(model, IN_CONTAINER[None])[0]
    assert start < FLOOR
    for a, b in ((IN_CONTAINER, halts[0].q), (halts[-2].q, halts[-1].q)):
        path = a + np.linspace(0, 1, 50)[:, None] * (b - a)
        assert lowest_height(model, path).min() > start - 0.003


def test_a_path_that_dips_is_not_clear(model):
    ends = np.array([TWISTED, UPRIGHT])
    assert lowest_height(model, ends).min() == pytest.approx(0.115, abs=0.001)
    assert not is_clear(model, ends[0], ends[1], FLOOR)
    assert not is_clear(model, ends[1], ends[0], FLOOR)
    assert is_clear(model, ends[0], ends[1], 0.0)  # it dips to 0.05 m


def test_a_path_that_dips_below_the_floor_leaves_the_workspace(model):
    ends = np.array([TWISTED, UPRIGHT])
    assert not FreeSpace(FLOOR).is_clear(model, ends[0], ends[1])
    assert FreeSpace(0.0).is_clear(model, ends[0], ends[1])


def test_the_lowest_point_may_be_the_elbow(model):
    leaning = np.array([0.0, -1.5, 0.0, 1.6, 0.0, 0.0, 0.0])
    assert model.sole_pose(leaning)[0][2] > 0.3
    assert lowest_height(model, leaning[None])[0] < 0.0


def test_measuring_poses_keep_clear_of_the_joint_stops(model, halts):
    for halt in halts[:-1]:
        assert (halt.q >= model.constants.q_lower + MARGIN - 1e-9).all()
        assert (halt.q <= model.constants.q_upper - MARGIN + 1e-9).all()


def test_poses_keep_room_for_their_approach_to_a_stop(model, poses):
    constants, chosen = model.constants, np.array(poses)
    room = np.minimum(chosen - constants.q_lower, constants.q_upper - chosen)
    assert room.min() == pytest.approx(MARGIN + OFFSET)


@pytest.mark.parametrize("choose", [choose_poses, choose_orientations])
def test_poses_are_visited_nearest_first(model, choose):
    path = [np.array(UPRIGHT), *choose(model, 8, SPACE)]
    for number, (here, there) in enumerate(pairwise(path), 1):
        left = [float(np.abs(q - here).max()) for q in path[number:]]
        assert float(np.abs(there - here).max()) == min(left)


@pytest.mark.parametrize("choose", [choose_poses, choose_orientations])
def test_the_only_free_pose_is_selected(model, poses, choose):
    class Narrow(FreeSpace):
        def is_free(self, q):
            return float(np.abs(q - poses[0]).max()) < OFFSET + 1e-6

    space = Narrow(FLOOR)
    (pose,) = choose(model, 1, space)
    assert (pose == poses[0]).all()
    with pytest.raises(SettingsError, match="Only 1 of 1000 poses"):
        choose(model, 2, space)


def test_each_pose_is_approached_from_below_and_from_above(halts):
    for number in range(12):
        at = [i for i, halt in enumerate(halts) if halt.pose == number]
        assert len(at) == 2
        sides = [halts[i - 1].q - halts[i].q for i in at]
        assert sides[0] == pytest.approx(np.full(7, -OFFSET))
        assert sides[1] == pytest.approx(np.full(7, OFFSET))
        assert {halts[i].speed for i in at} == {APPROACH_SPEED}


def test_the_sole_never_exceeds_its_speed_limit(model, halts):
    here = IN_CONTAINER
    for halt in halts:
        move = JointMove(here, halt.q, halt.speed)
        times = np.linspace(0, move.duration, 200)
        sole = model.sole_path(np.array([move.at(t)[0] for t in times])).position
        speed = np.linalg.norm(np.diff(sole, axis=0), axis=1).max() / times[1]
        assert speed < 1.05 * POINT_SPEED  # sampled every 0.04 rad
        here = halt.q


def test_a_wide_sweep_is_slower_than_a_turn_of_the_wrist(model):
    q = np.array([0.0, 1.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    swing, turn = q.copy(), q.copy()
    swing[0] += 1.0
    turn[6] += 1.0
    assert leg_speed(model, q, swing) < 0.4
    assert leg_speed(model, q, turn) == 0.5


def test_the_arm_ends_where_it_began(halts):
    assert (halts[-1].q == IN_CONTAINER).all()
    assert halts[-2].q.tolist() == list(UPRIGHT)


def test_the_duration_of_a_path_is_that_of_its_moves(halts):
    assert travel_time(IN_CONTAINER, halts) == pytest.approx(
        travel_time(IN_CONTAINER, halts[:5]) + travel_time(halts[4].q, halts[5:])
    )
    assert travel_time(IN_CONTAINER, halts[:1]) > 0.0


def test_a_container_that_is_too_high_is_refused(model):
    with pytest.raises(SettingsError, match=r"poses keep the arm above 1\.20 m"):
        choose_poses(model, 12, FreeSpace(1.2))


def test_an_arm_that_cannot_rise_is_refused(model, poses):
    with pytest.raises(SettingsError, match="cannot rise"):
        plan_waypoints(model, np.array(TWISTED), poses, SPACE)


def test_the_elbow_is_where_the_upper_arm_ends(model):
    """On the sphere of the upper arm, lower by the offset of the elbow's axis."""
    constants = model.constants
    q = np.zeros((2, 7))
    q[:, 0], q[:, 1] = (0.7, -1.1), (0.4, 1.2)
    found = elbow_position(constants, q)
    for row, (q1, q2) in zip(found, q[:, :2], strict=True):
        out = 0.55 * np.sin(q2)
        expected = [out * np.cos(q1), out * np.sin(q1), 0.55 * np.cos(q2) - 0.045]
        assert row == pytest.approx(expected)


@pytest.mark.parametrize("joint", [0, 3, 6])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_pose_beyond_a_stop_is_refused_with_its_joint(model, joint, side):
    constants = model.constants
    stops = constants.q_lower if side == "lower" else constants.q_upper
    inward = 1.0 if side == "lower" else -1.0
    low = FreeSpace(-5.0)
    pose = np.array(UPRIGHT)
    pose[joint] = stops[joint] + inward * (OFFSET + 1e-6)
    check_poses(model, [pose], low)
    pose[joint] = stops[joint] + inward * (OFFSET - 1e-6)
    with pytest.raises(SettingsError, match=f"Pose 2 .* joint {joint + 1} is beyond"):
        check_poses(model, [np.array(UPRIGHT), pose], low)


def test_the_upright_pose_has_elbow_and_foot_high(model):
    upright = np.array(UPRIGHT)
    assert lowest_height(model, upright[None])[0] > FLOOR + 0.1
    assert (upright > model.constants.q_lower + MARGIN).all()
    assert (upright < model.constants.q_upper - MARGIN).all()


def test_no_pose_is_too_far_from_upright(poses):
    assert (np.abs(np.array(poses) - UPRIGHT) <= REACH + 1e-12).all()
    assert (np.ptp(np.array(poses)[:, 1:], axis=0) > 0.5 * REACH[1:]).all()


def test_a_pose_without_a_direct_path_is_reached_through_upright(model):
    """The direct path dips; the path through the upright pose does not."""
    low, other = (np.array(UPRIGHT) + d for d in ([0] * 7, [0] * 7))
    low[[1, 3]] += (0.9, 0.9)
    other[[1, 3]] += (-0.9, 0.4)

    class Space(FreeSpace):
        def is_clear(self, model, start, goal):
            return bool((start == UPRIGHT).all() or (goal == UPRIGHT).all())

    halts = plan_waypoints(
        model, np.array(UPRIGHT), [low, other], Space(-5.0), is_two_sided=False
    )
    labels = ["upright" if (halt.q == UPRIGHT).all() else halt.pose for halt in halts]
    assert labels == ["upright", 0, "upright", 1, "upright", "upright"]


def test_the_sole_limits_the_speed_of_a_leg(model):
    """A swing of joint 1 alone: the sole moves on a circle of known radius."""
    q = np.array([0.0, 1.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    x, y, _ = model.sole_pose(q)[0]
    goal = q.copy()
    goal[0] += 1.0
    assert leg_speed(model, q, goal) == pytest.approx(
        POINT_SPEED / np.hypot(x, y), rel=0.01
    )


@pytest.mark.parametrize(
    ("heights", "is_free"),
    [
        ([0.5, 0.5, 0.5, 0.5], True),
        ([0.5, 0.2, 0.5, 0.5], False),
        ([0.5, 0.5, 0.2, 0.5], False),
        ([0.2, 0.25, 0.5, 0.5], True),
        ([0.5, 0.5, 0.25, 0.2], True),
        ([0.5, 0.331, 0.329, 0.5], True),
        ([0.5, 0.327, 0.5, 0.5], False),
        ([0.2, 0.197, 0.5, 0.5], False),
    ],
)
def test_a_path_is_no_lower_than_the_floor_or_its_ends(
    model, monkeypatch, heights, is_free
):
    monkeypatch.setattr(free_space, "lowest_height", lambda *_: np.array(heights))
    assert is_clear(model, np.zeros(7), np.ones(7), 0.33) is is_free


class FarApart:
    """A clearance in which nothing is near, with an optional collision on the path."""

    def __init__(self, hit=None):
        self.hit = hit

    def nearest(self, q):
        return BodyGap("the foot", "the base", 1.0)

    def first_collision(self, start, goal):
        return self.hit


def test_a_pose_whose_path_dips_is_refused(model, monkeypatch):
    space = FreeSpace(FLOOR, FarApart())
    check_poses(model, [np.array(UPRIGHT)], space)

    monkeypatch.setattr(free_space, "is_clear", lambda *_: False)
    with pytest.raises(SettingsError, match=r"Pose 1 .* would come below"):
        check_poses(model, [np.array(UPRIGHT)], space)


def test_a_pose_with_a_collision_on_its_path_is_refused(model):
    hit = BodyGap("the elbow", "the container", 0.012)
    space = FreeSpace(-5.0, FarApart(hit))

    with pytest.raises(SettingsError, match="on the way to it the elbow 12 mm from"):
        check_poses(model, [np.array(UPRIGHT)], space)


def test_a_pose_is_chosen_only_if_both_approaches_are_free(model):
    class Asked(FreeSpace):
        asked: ClassVar[set] = set()

        def is_free(self, q):
            self.asked.add(tuple(np.round(q, 6)))
            return super().is_free(q)

    for pose in choose_poses(model, 4, Asked(FLOOR)):
        for side in (-OFFSET, 0.0, OFFSET):
            assert tuple(np.round(pose + side, 6)) in Asked.asked
            assert lowest_height(model, (pose + side)[None])[0] > FLOOR


class ClosedTo(FreeSpace):
    """A space in which joint 6 may not be turned far."""

    def is_clear(self, model, start, goal):
        return abs(goal[5] - start[5]) < 0.5 and super().is_clear(model, start, goal)


@pytest.mark.parametrize("space", [SPACE, ClosedTo(FLOOR)])
def test_a_turn_of_the_wrist_turns_gravity_across_the_sensor(model, space):
    upright, tilted = tilted_pair(model, space)
    assert space.is_clear(model, upright, tilted)
    first, second = (model.plate_pose(q)[1][2] for q in (upright, tilted))
    assert np.hypot(*(second - first)[:2]) > 0.6


@pytest.mark.parametrize(
    ("closed", "joint", "angle"),
    [
        ([], 6, -1.2),
        ([(6, -1.2)], 5, 1.0),
        ([(6, -1.2), (5, 1.0)], 5, -1.0),
        ([(6, -1.2), (5, 1.0), (5, -1.0)], 6, -0.6),
    ],
)
def test_a_wrist_is_turned_in_the_first_free_direction(model, closed, joint, angle):
    class PartlyClosed(FreeSpace):
        def is_clear(self, model, start, goal):
            turn = goal - start
            return not any(np.isclose(turn[j - 1], by) for j, by in closed)

    upright, tilted = tilted_pair(model, PartlyClosed(FLOOR))
    turned = np.zeros(7)
    turned[joint - 1] = angle
    assert tilted - upright == pytest.approx(turned)


def test_a_wrist_that_cannot_turn_anywhere_is_refused(model):
    class Closed(FreeSpace):
        def is_free(self, q):
            return False

    with pytest.raises(SettingsError, match="wrist"):
        tilted_pair(model, Closed(FLOOR))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_pose_may_be_as_close_to_a_stop_as_its_approach_allows(model, side):
    constants, pose = model.constants, np.array(UPRIGHT)
    stop = constants.q_lower if side < 0.0 else constants.q_upper
    pose[6] = stop[6] - side * OFFSET
    check_poses(model, [pose], SPACE)
    pose[6] += side * 1e-9
    with pytest.raises(SettingsError, match="joint 7 is beyond its stop"):
        check_poses(model, [pose], SPACE)
