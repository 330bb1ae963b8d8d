from .gravity import GravityGuide
from .pose_walk import guided
from .sensor import SensorGuide
from .surroundings import read_poses
from .terrain import TerrainGuide

__all__ = [
    "GravityGuide",
    "SensorGuide",
    "TerrainGuide",
    "guided",
    "read_poses",
]
