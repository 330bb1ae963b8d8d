"""Calibrations keep clear of arm, floor and container, whoever chose the poses."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from experiments.rig.build import build_tool, terrain_frame
from experiments.run.surroundings import container_box, free_space, read_poses
from experiments.settings.load import load_settings
from tests.experiments.program import traction, write_config
from wam.calibration.free_space import UPRIGHT, FreeSpace, check_poses
from wam.calibration.poses import choose_orientations, choose_poses, plan_halts
from wam.model.arm_model import ArmModel
from wam.model.clearance import BASE_HEIGHT, CLEARANCE_MARGIN, BodyGap
from wam.model.constants import load_constants

SETTINGS = load_settings(None)
ROWS = {row.name: row for row in SETTINGS.matrix.terrains}
A_ROW_OF_EACH_FOOT = {row.foot: name for name, row in ROWS.items()}
SAFE = [
    list(UPRIGHT),
    [0.0, -0.6, 0.3, 1.9, 0.2, -0.4, 0.0],
    [0, -0.2, 0, 1.7, 0, 0, 0],
]
FLOOR = [0.0, 1.9, 0.0, 0.6, 0.0, 0.0, 0.0]
ANY = range(100)
CONTAINER = [0.0, 0.9, 0.0, 1.1, 0.0, 1.1, 0.0]


def model_of(row):
    return ArmModel(load_constants(), build_tool(SETTINGS.rig, row.foot))


@pytest.mark.parametrize("name", ROWS)
def test_a_container_reaches_from_the_floor_to_its_rim_and_beyond_the_trial(name):
    frame = terrain_frame(ROWS[name])
    box = container_box(frame)
    half = 0.5 * box.size
    for along in (0.0, frame.travel):
        point = np.array(frame.far_end) + along * frame.axes()[0]
        inside = np.abs(box.rotation.T @ (point - box.center))
        assert (inside < half).all()
    bottom = box.center - half[2] * box.rotation[:, 2]
    assert bottom[2] < -BASE_HEIGHT + 0.15


@pytest.mark.parametrize("name", A_ROW_OF_EACH_FOOT.values(), ids=A_ROW_OF_EACH_FOOT)
@pytest.mark.parametrize("choose", [choose_poses, choose_orientations])
def test_every_shipped_pose_and_way_is_clear_for_every_foot(name, choose):
    row = ROWS[name]
    model, space = model_of(row), free_space(SETTINGS, row)
    poses = choose(model, 12, space)
    assert min(space.clearance.nearest(q).distance for q in poses) > CLEARANCE_MARGIN
    start = np.array(row.start_q)
    halts = plan_halts(model, start, poses, space)
    assert len({halt.pose for halt in halts} - {None}) == 12
    here = start
    for halt in halts:
        assert space.clearance.first_hit(here, halt.q) is None
        here = halt.q


def test_an_arm_below_something_is_not_lifted_through_it():
    row = ROWS["S15"]
    model, space = model_of(row), free_space(SETTINGS, row)
    beside = np.array([1.2, 1.2, 0.0, 1.6, 0.0, 0.5, 0.0])  # lower than the container
    with pytest.raises(SettingsError, match="cannot rise"):
        plan_halts(model, np.array([*(-beside[:1]), *beside[1:]]), [], space)


def listed(folder, poses):
    path = folder / "poses.toml"
    path.write_text(f"poses = {[list(map(float, pose)) for pose in poses]}\n")
    return path


def test_safe_poses_of_a_person_are_taken_as_they_are(tmp_path):
    found = read_poses(listed(tmp_path, SAFE), SETTINGS, ROWS["TF"], ANY)
    assert np.array(found).tolist() == np.array(SAFE, dtype=float).tolist()


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (FLOOR, "the floor"),
        (CONTAINER, "the container"),
        ([9.0] * 7, "beyond its stop"),
    ],
)
def test_a_pose_that_would_collide_is_refused_before_anything_moves(
    tmp_path, pose, words
):
    path = listed(tmp_path, [*SAFE, pose])
    config = write_config(tmp_path)
    options = ("--fake", "--fast", "--operator-script", "auto", "--config", config)
    done = traction("calibrate", "gravity", *options, "--pose-file", path)
    assert done.code == 2, done.err
    assert done.err.startswith("Pose 4 cannot be used")
    assert words in done.err
    assert done.out == ""


@pytest.mark.parametrize(
    "text",
    [
        "",
        "poses = [[1.0, 2.0]]",
        "poses = 3",
        "poses = [[nan, 0, 0, 0, 0, 0, 0]]",
        "poses = [[true, 0, 0, 0, 0, 0, 0]]",
        "poses = [[11.0, 0, 0, 0, 0, 0, 0]]",
        "poses = [[0, 0, 0, 0, 0, 0, 0]]\nspeed = 3",
        "poses = " + "[" * 2000,
        "#" * 1_000_001,
        "poses = [[9223372036854775808, 0, 0, 0, 0, 0, 0]]",
    ],
    ids=lambda text: text[:40],
)
def test_a_file_without_poses_is_refused(tmp_path, text):
    path = tmp_path / "poses.toml"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"holds no poses"):
        read_poses(path, SETTINGS, ROWS["TF"], ANY)


def test_too_few_poses_and_a_terrain_take_none(tmp_path):
    path = listed(tmp_path, SAFE[:2])
    config = write_config(tmp_path)
    for what in ("gravity", "terrain"):
        options = ("--fake", "--fast", "--config", config, "--pose-file", path)
        done = traction("calibrate", what, *options)
        assert done.code == 2
        assert "2 poses" in done.err


@pytest.mark.parametrize("side", [-1.0, 0.0, 1.0])
def test_a_pose_is_looked_at_from_both_sides_it_is_approached_from(side):
    """A thin post 31 mm from the foot: 30 mrad towards it and it is too close."""

    class Post:
        def nearest(self, q):
            at = float(np.round((q - SAFE[1])[0], 3))
            is_close = at == side * 0.03
            return BodyGap("the foot", "the post", 0.02 if is_close else 1.0)

        def first_hit(self, start, goal):
            return None

    row = ROWS["TF"]
    space = FreeSpace(-5.0, Post())
    with pytest.raises(SettingsError, match=r"Pose 1 .* 20 mm from the post"):
        check_poses(model_of(row), [np.array(SAFE[1])], space)


@pytest.mark.parametrize("count", [2, 61, 30_000])
def test_poses_are_counted_before_any_is_looked_at(tmp_path, count):
    """Poses that would be refused for what they are; in a file of under 1 MB."""
    path = tmp_path / "poses.toml"
    path.write_text(f"poses = [{'[9,9,9,9,9,9,9],' * count}]")
    with pytest.raises(SettingsError, match=rf"{count} poses - expected 3\.\.60"):
        read_poses(path, SETTINGS, ROWS["TF"], range(3, 61))


def test_poses_are_not_read_from_a_device():
    with pytest.raises(SettingsError, match="not a file"):
        read_poses(Path("/dev/zero"), SETTINGS, ROWS["TF"], ANY)
