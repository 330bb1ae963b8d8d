# pyright: reportUnknownVariableType=false
from .plant import ArmPlant, PlantOptions
from .push import PACES, Pace

__all__ = [
    "PACES",
    "ArmPlant",
    "Pace",
    "PlantOptions",
]
