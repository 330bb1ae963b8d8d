"""Moves of a calibration keep clear of arm, floor and container."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from experiments.rig.build import build_tool, terrain_frame
from experiments.run.free_space_of_rig import container_box, free_space
from experiments.settings.load import load_settings
from wam.calibration.free_space import FreeSpace, check_poses
from wam.calibration.poses import choose_orientations, choose_poses, plan_waypoints
from wam.model.arm_model import ArmModel
from wam.model.clearance import BASE_HEIGHT, CLEARANCE_MARGIN, BodyGap
from wam.model.constants import load_constants

SETTINGS = load_settings(None)
ROWS = {row.name: row for row in SETTINGS.matrix.terrains}
A_ROW_OF_EACH_FOOT = {row.foot: name for name, row in ROWS.items()}
SAFE = np.array([0.0, -0.6, 0.3, 1.9, 0.2, -0.4, 0.0])


def model_of(row):
    return ArmModel(load_constants(), build_tool(SETTINGS.rig, row.foot))


@pytest.mark.parametrize("name", ROWS)
def test_a_container_box_reaches_to_the_floor_and_beyond_the_trial(name):
    frame = terrain_frame(ROWS[name])
    box = container_box(frame)
    half = 0.5 * box.size
    for along in (0.0, frame.travel):
        point = np.array(frame.start) + along * frame.axes()[0]
        inside = np.abs(box.rotation.T @ (point - box.center))
        assert (inside < half).all()
    bottom = box.center - half[2] * box.rotation[:, 2]
    assert bottom[2] < -BASE_HEIGHT + 0.15


@pytest.mark.parametrize("name", A_ROW_OF_EACH_FOOT.values(), ids=A_ROW_OF_EACH_FOOT)
@pytest.mark.parametrize("choose", [choose_poses, choose_orientations])
def test_every_calibration_pose_and_path_is_clear_for_every_foot(name, choose):
    row = ROWS[name]
    model, space = model_of(row), free_space(SETTINGS, row)
    poses = choose(model, 12, space)
    assert min(space.clearance.nearest(q).distance for q in poses) > CLEARANCE_MARGIN
    start = np.array(row.start_q)
    halts = plan_waypoints(model, start, poses, space)
    assert len({halt.pose for halt in halts} - {None}) == 12
    here = start
    for halt in halts:
        assert space.clearance.first_collision(here, halt.q) is None
        here = halt.q


def test_an_arm_below_the_rim_is_not_lifted_through_the_container():
    row = ROWS["S15"]
    model, space = model_of(row), free_space(SETTINGS, row)
    low_pose = np.array([1.2, 1.2, 0.0, 1.6, 0.0, 0.5, 0.0])  # lower than the container
    with pytest.raises(SettingsError, match="cannot rise"):
        plan_waypoints(model, np.array([*(-low_pose[:1]), *low_pose[1:]]), [], space)


@pytest.mark.parametrize("side", [-1.0, 0.0, 1.0])
def test_a_pose_is_checked_slightly_to_both_sides_too(side):
    """A thin post that is too close only 30 mrad to one side of the pose."""

    class Post:
        def nearest(self, q):
            at = float(np.round((q - SAFE)[0], 3))
            is_close = at == side * 0.03
            return BodyGap("the foot", "the post", 0.02 if is_close else 1.0)

        def first_collision(self, start, goal):
            return None

    row = ROWS["TF"]
    space = FreeSpace(-5.0, Post())
    with pytest.raises(SettingsError, match=r"Pose 1 .* 20 mm from the post"):
        check_poses(model_of(row), [SAFE], space)
