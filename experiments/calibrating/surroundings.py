"""What a calibration's moves keep clear of, and poses that a person has chosen."""

import tomllib
from pathlib import Path

import numpy as np

from acquisition import SettingsError
from experiments.rig import build_tool, terrain_frame
from experiments.settings import Settings, TerrainRow
from ft_sensor import TerrainFrame
from wam.calibration import FreeSpace, check_poses
from wam.model import (
    BASE_HEIGHT,
    ArmClearance,
    ArmModel,
    Array,
    ObstacleBox,
    load_constants,
)

ABOVE = 0.10  # m that sole, plate and elbow stay above the highest container
RIM = 0.03  # of a container above its plane [m]
_BESIDE, _BEYOND = 0.25, 0.10  # half a container's width, and past a trial's ends [m]
_JOINTS = 7


def container_box(frame: TerrainFrame) -> ObstacleBox:
    """Return the container as a box that stands on the floor."""
    axes = frame.axes()
    deep = frame.far_end[2] + BASE_HEIGHT
    size = np.array([frame.travel + 2.0 * _BEYOND, 2.0 * _BESIDE, deep + RIM])
    middle = np.array([0.5 * frame.travel, 0.0, 0.5 * (RIM - deep)])
    center = np.array(frame.far_end) + middle @ axes
    return ObstacleBox("the container", center, size, axes.T)


def free_space(settings: Settings, row: TerrainRow) -> FreeSpace:
    """Return where the arm may move with the foot and beside the container of `row`."""
    floor = max(row.far_end[2] for row in settings.matrix.terrains) + ABOVE
    tool = build_tool(settings.rig, row.foot)
    box = container_box(terrain_frame(row))
    return FreeSpace(floor, ArmClearance(load_constants(), tool, (box,)))


def read_poses(path: Path, settings: Settings, row: TerrainRow) -> list[Array]:
    """Return the poses [rad], shape (7,) each, of a file that a person wrote.

    It is TOML: `poses = [[0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0], ...]`, joints 1 to 7.

    Raises:
        SettingsError: no such file, no poses, or one that is not safe.
    """
    try:
        content = tomllib.loads(path.read_text())
        poses = np.array(content["poses"], dtype=np.float64)
    except (OSError, UnicodeError, ValueError, TypeError, KeyError) as error:
        raise _unread(path, str(error) or "no poses") from error
    if poses.ndim != 2 or poses.shape[1] != _JOINTS or not np.isfinite(poses).all():
        raise _unread(path, f"expected rows of {_JOINTS} numbers")
    model = ArmModel(load_constants(), build_tool(settings.rig, row.foot))
    check_poses(model, list(poses), free_space(settings, row))
    return list(poses)


def _unread(path: Path, why: str) -> SettingsError:
    return SettingsError(
        f"{path} holds no poses: {why}.",
        hint="Write poses = [[...], ...], seven angles in rad each. Nothing was "
        "started.",
    )
