# pyright: reportUnknownVariableType=false
from .arm_model import ArmModel, add_point, build_pinocchio, drive_inertia_matrix, urdf
from .clearance import (
    BASE_HEIGHT,
    CLEARANCE_MARGIN,
    ArmClearance,
    BodyGap,
    ObstacleBox,
    straight_way,
)
from .constants import GRAVITY, ArmConstants, Array, Body, load_constants
from .friction import (
    ELASTIC,
    MotorFriction,
    friction_of,
    joint_coulomb,
    motor_shares,
    motor_turns,
    plastic_share,
)
from .gravity import MAX_VIRTUAL_MASS, VirtualMass, compensation, gravity_model
from .moments import (
    MomentFit,
    ZeroErrors,
    check_fit,
    check_zeros,
    fit_moments,
    regressor,
    zero_errors,
)
from .tool import Tool, sensor_body, tool_metadata, tool_of

__all__ = [
    "BASE_HEIGHT",
    "CLEARANCE_MARGIN",
    "ELASTIC",
    "GRAVITY",
    "MAX_VIRTUAL_MASS",
    "ArmClearance",
    "ArmConstants",
    "ArmModel",
    "Array",
    "Body",
    "BodyGap",
    "MomentFit",
    "MotorFriction",
    "ObstacleBox",
    "Tool",
    "VirtualMass",
    "ZeroErrors",
    "add_point",
    "build_pinocchio",
    "check_fit",
    "check_zeros",
    "compensation",
    "drive_inertia_matrix",
    "fit_moments",
    "friction_of",
    "gravity_model",
    "joint_coulomb",
    "load_constants",
    "motor_shares",
    "motor_turns",
    "plastic_share",
    "regressor",
    "sensor_body",
    "straight_way",
    "tool_metadata",
    "tool_of",
    "urdf",
    "zero_errors",
]
