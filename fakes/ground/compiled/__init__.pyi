from .grounds import CompiledGround, compiled_ground
from .layout import DONE, GIVEN, GROUND
from .steps import ground_step

__all__ = [
    "DONE",
    "GIVEN",
    "GROUND",
    "CompiledGround",
    "compiled_ground",
    "ground_step",
]
