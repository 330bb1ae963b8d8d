"""The poses of a calibration as a person has chosen them: a TOML file."""

from pathlib import Path
from typing import cast

import numpy as np
from pydantic import ValidationError

from acquisition.errors import SettingsError
from acquisition.settings import Near, SettingsSection, parse_toml, read_text
from acquisition.validation import first_problem
from experiments.rig.build import build_tool
from experiments.run.surroundings import free_space
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from wam.calibration.free_space import check_poses
from wam.model.arm_model import ArmModel
from wam.model.constants import Array, load_constants


class PoseFile(SettingsSection):
    """Joint positions [rad] that a person has chosen, joints 1 to 7 in each row."""

    poses: tuple[tuple[Near, Near, Near, Near, Near, Near, Near], ...]


def read_poses(
    path: Path, settings: Settings, row: TerrainRow, counts: range
) -> list[Array]:
    """Return the poses [rad], shape (7,) each, of a file that a person wrote.

    It is TOML: `poses = [[0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0], ...]`, joints 1 to 7.
    `counts`: how many there may be; none where a calibration takes no poses.

    Raises:
        SettingsError: no such file, no poses, as many as are not taken, or one that is
            not safe.
    """
    poses = [np.array(pose) for pose in _parse(path, counts).poses]
    model = ArmModel(load_constants(), build_tool(settings.rig, row.foot))
    check_poses(model, poses, free_space(settings, row))
    return poses


def _parse(path: Path, counts: range) -> PoseFile:
    """Read the file; of a list that is too long no member is looked at."""
    try:
        table = parse_toml(read_text(path))
    except (OSError, ValueError) as error:
        raise _unread(path, getattr(error, "strerror", None) or str(error)) from error
    listed = table.get("poses")
    if not isinstance(listed, list):
        raise _unread(path, "no list of that name")
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
        raise _unread(path, first_problem(error)) from error


def _unread(path: Path, why: str) -> SettingsError:
    return SettingsError(
        f"{path} holds no poses: {why}.",
        hint="Write poses = [[...], ...], seven angles in rad each. Nothing was "
        "started.",
    )
