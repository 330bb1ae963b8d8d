# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
"""The one door to numba: what is compiled, how, and where its machine code is kept.

No fast mathematics: every operation rounds as Python's does, none is left out, and a
product and a sum are never made one. Division by zero gives infinity or no number.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba
from numba.core import config

from fakes.kernels.choice import kernel_folder

P = ParamSpec("P")
R = TypeVar("R")


def inline(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` as a part of the kernels that call it."""
    return numba.njit(error_model="numpy")(function)


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function`, which Python calls; its machine code is kept."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(kernel_folder())
    try:
        return numba.njit(error_model="numpy", cache=True)(function)
    finally:
        config.CACHE_DIR = before
