from .choice import (
    COMPILED,
    ENVIRONMENT,
    PINOCCHIO,
    chosen_dynamics,
    is_compiled_first,
    kernel_folder,
    mark_ready,
)
from .compiler import inline, kernel

__all__ = [
    "COMPILED",
    "ENVIRONMENT",
    "PINOCCHIO",
    "chosen_dynamics",
    "inline",
    "is_compiled_first",
    "kernel",
    "kernel_folder",
    "mark_ready",
]
