from .controller import FootController
from .joint_lock import LockGains
from .position_control import TOP_SPEED, JointMove, move_reference
from .soft_walls import SoftWalls, Walls

__all__ = [
    "TOP_SPEED",
    "FootController",
    "JointMove",
    "LockGains",
    "SoftWalls",
    "Walls",
    "move_reference",
]
