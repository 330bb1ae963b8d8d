from .controller import FootController
from .friction_compensation import (
    SWUNG_MOTOR,
    FrictionCompensation,
    KnownFriction,
    known_friction,
)
from .joint_lock import LockGains
from .position_control import TOP_SPEED, JointMove, move_reference
from .soft_walls import SoftWalls, Walls
from .sole_impedance import LARGEST_F_N, LARGEST_F_T, SoleAxes, SoleImpedance

__all__ = [
    "LARGEST_F_N",
    "LARGEST_F_T",
    "SWUNG_MOTOR",
    "TOP_SPEED",
    "FootController",
    "FrictionCompensation",
    "JointMove",
    "KnownFriction",
    "LockGains",
    "SoftWalls",
    "SoleAxes",
    "SoleImpedance",
    "Walls",
    "known_friction",
    "move_reference",
]
