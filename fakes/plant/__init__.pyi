# pyright: reportUnknownVariableType=false
from .hand import touched_place
from .model import PlantOptions
from .plant import ArmPlant
from .push import PACES, Pace

__all__ = [
    "PACES",
    "ArmPlant",
    "Pace",
    "PlantOptions",
    "touched_place",
]
