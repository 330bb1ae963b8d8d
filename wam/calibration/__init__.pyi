from .free_space import FreeSpace, check_poses
from .gravity_file import (
    GravityCalibration,
    fits_tool,
    gravity_from_toml,
    gravity_to_toml,
)
from .poses import (
    APPROACH_SPEED,
    MeasurementPose,
    choose_orientations,
    choose_poses,
    plan_halts,
    tilted_pair,
    way_seconds,
)

__all__ = [
    "APPROACH_SPEED",
    "FreeSpace",
    "GravityCalibration",
    "MeasurementPose",
    "check_poses",
    "choose_orientations",
    "choose_poses",
    "fits_tool",
    "gravity_from_toml",
    "gravity_to_toml",
    "plan_halts",
    "tilted_pair",
    "way_seconds",
]
