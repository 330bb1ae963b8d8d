from .gravity import GravityGuide
from .sensor import SensorGuide
from .terrain import TerrainGuide

__all__ = [
    "GravityGuide",
    "SensorGuide",
    "TerrainGuide",
]
