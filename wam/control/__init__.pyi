from .controller import FootController
from .joint_lock import LockGains
from .position_control import TOP_SPEED, JointMove
from .soft_walls import SoftWalls, Walls

__all__ = [
    "TOP_SPEED",
    "FootController",
    "JointMove",
    "LockGains",
    "SoftWalls",
    "Walls",
]
