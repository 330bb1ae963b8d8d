from .excitation import CENTRES, FrictionLeg, LegUse, plan_friction
from .free_space import FreeSpace, check_poses
from .friction_file import (
    FrictionCalibration,
    friction_from_toml,
    friction_to_toml,
    truth_to_toml,
)
from .friction_fit import FrictionFit, check_friction, fit_friction
from .friction_reach import (
    FrictionReach,
    FrictionTorques,
    RenderedMasses,
    friction_reach,
    poses_along,
    reaches_along,
    remaining_friction,
    rendered_masses,
)
from .gravity_file import (
    GravityCalibration,
    fits_tool,
    gravity_from_toml,
    gravity_to_toml,
)
from .joint_friction import (
    joint_asymmetry,
    joint_breakaway,
    joint_deviation,
    speed_curve,
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
from .sliding import RecordedLeg, SlidingRows, sliding_rows

__all__ = [
    "APPROACH_SPEED",
    "CENTRES",
    "FreeSpace",
    "FrictionCalibration",
    "FrictionFit",
    "FrictionLeg",
    "FrictionReach",
    "FrictionTorques",
    "GravityCalibration",
    "LegUse",
    "MeasurementPose",
    "RecordedLeg",
    "RenderedMasses",
    "SlidingRows",
    "check_friction",
    "check_poses",
    "choose_orientations",
    "choose_poses",
    "fit_friction",
    "fits_tool",
    "friction_from_toml",
    "friction_reach",
    "friction_to_toml",
    "gravity_from_toml",
    "gravity_to_toml",
    "joint_asymmetry",
    "joint_breakaway",
    "joint_deviation",
    "plan_friction",
    "plan_halts",
    "poses_along",
    "reaches_along",
    "remaining_friction",
    "rendered_masses",
    "sliding_rows",
    "speed_curve",
    "tilted_pair",
    "truth_to_toml",
    "way_seconds",
]
