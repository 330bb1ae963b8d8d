"""Poses of a file are read and checked before the arm moves."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from experiments.calibration.pose_file import read_poses
from experiments.settings.load import load_settings
from tests.experiments.program import traction, write_config
from wam.calibration.free_space import UPRIGHT

SETTINGS = load_settings(None)
ROW = SETTINGS.row("TF")
SAFE = [
    list(UPRIGHT),
    [0.0, -0.6, 0.3, 1.9, 0.2, -0.4, 0.0],
    [0, -0.2, 0, 1.7, 0, 0, 0],
]
FLOOR = [0.0, 1.9, 0.0, 0.6, 0.0, 0.0, 0.0]
CONTAINER = [0.0, 0.9, 0.0, 1.1, 0.0, 1.1, 0.0]
ANY = range(100)


def listed(folder, poses):
    path = folder / "poses.toml"
    path.write_text(f"poses = {[list(map(float, pose)) for pose in poses]}\n")
    return path


def test_safe_poses_are_taken_unchanged(tmp_path):
    poses = read_poses(listed(tmp_path, SAFE), SETTINGS, ROW, ANY)
    assert np.array(poses).tolist() == np.array(SAFE, dtype=float).tolist()


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
        read_poses(path, SETTINGS, ROW, ANY)


def test_too_few_poses_are_refused_by_gravity_and_terrain(tmp_path):
    path = listed(tmp_path, SAFE[:2])
    config = write_config(tmp_path)
    for what in ("gravity", "terrain"):
        options = ("--fake", "--fast", "--config", config, "--pose-file", path)
        done = traction("calibrate", what, *options)
        assert done.code == 2
        assert "2 poses" in done.err


@pytest.mark.parametrize("count", [2, 61, 30_000])
def test_poses_are_counted_before_any_is_checked(tmp_path, count):
    """The poses themselves are invalid too; the file has less than 1 MB."""
    path = tmp_path / "poses.toml"
    path.write_text(f"poses = [{'[9,9,9,9,9,9,9],' * count}]")
    with pytest.raises(SettingsError, match=rf"{count} poses - expected 3\.\.60"):
        read_poses(path, SETTINGS, ROW, range(3, 61))


def test_poses_are_not_read_from_a_device():
    with pytest.raises(SettingsError, match="not a file"):
        read_poses(Path("/dev/zero"), SETTINGS, ROW, ANY)
