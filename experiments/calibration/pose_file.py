"""Poses of a calibration from a TOML file."""

from pathlib import Path
from typing import cast

import numpy as np
from pydantic import ValidationError

from acquisition.errors import SettingsError
from acquisition.settings import Near, SettingsSection, parse_toml, read_text
from acquisition.validation import first_problem
from experiments.rig.build import build_tool
from experiments.run.free_space_of_rig import free_space
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from wam.calibration.free_space import check_poses
from wam.model.arm_model import ArmModel
from wam.model.constants import Array, load_constants


class PoseFile(SettingsSection):
    """Joint positions [rad], joints 1 to 7 in each row."""

    poses: tuple[tuple[Near, Near, Near, Near, Near, Near, Near], ...]


def read_poses(
    path: Path, settings: Settings, row: TerrainRow, counts: range
) -> list[Array]:
    """Read poses [rad], shape (7,) each, from a TOML file.

    Format: `poses = [[0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0], ...]`, joints 1 to 7.
    `counts`: permitted numbers of poses; empty if a calibration takes none.

    Raises:
        SettingsError: the file is missing, has no poses or a wrong number of them, or
            a pose is not safe.
    """
    poses = [np.array(pose) for pose in _parse(path, counts).poses]
    model = ArmModel(load_constants(), build_tool(settings.rig, row.foot))
    check_poses(model, poses, free_space(settings, row))
    return poses


def _parse(path: Path, counts: range) -> PoseFile:
    """Read the file; a list that is too long is refused before its validation."""
    try:
        table = parse_toml(read_text(path))
    except (OSError, ValueError) as error:
        raise _unreadable(
            path, getattr(error, "strerror", None) or str(error)
        ) from error
    listed = table.get("poses")
    if not isinstance(listed, list):
        raise _unreadable(path, "no list of that name")
    count = len(cast("list[object]", listed))
    if count not in counts:
        wanted = f"{counts[0]}..{counts[-1]}" if counts else "none"
        raise SettingsError(
            f"{path}: {count} poses - expected {wanted}.",
            hint="A terrain is touched by hand, without poses. Nothing was started.",
        )
    try:
        return PoseFile.model_validate(table)
    except ValidationError as error:
        raise _unreadable(path, first_problem(error)) from error


def _unreadable(path: Path, why: str) -> SettingsError:
    return SettingsError(
        f"{path} holds no poses: {why}.",
        hint="Write poses = [[...], ...], seven angles in rad each. Nothing was "
        "started.",
    )
