from .friction import FrictionGuide
from .gravity import GravityGuide
from .sensor import SensorGuide
from .terrain import TerrainGuide

__all__ = [
    "FrictionGuide",
    "GravityGuide",
    "SensorGuide",
    "TerrainGuide",
]
