"""The ground of one trial: a plate or a bed of stones."""

from typing import Protocol

import numpy as np

from fakes.ground.contact import Contact, Motion
from fakes.ground.plate import PLATES, Plate
from fakes.ground.stone_sizes import STONES
from fakes.ground.stones import StoneBed


class Terrain(Protocol):
    """Ground that a foot can stand and slip on."""

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        ...

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed ground at `x` [m]."""
        ...

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        ...

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the contact by `dt` [s] and return what it does to the foot."""
        ...


def make_terrain(
    stones: str, foot: str, incline: float, rng: np.random.Generator
) -> Plate | StoneBed:
    """Return the ground of one trial.

    Args:
        stones: "small", "big" or "none" (a plate).
        foot: "tread" or "bare"; matters on plates.
        incline: of the container [rad].
        rng: generator of this trial.
    """
    if stones == "none":
        return Plate(PLATES[foot], rng)
    return StoneBed(STONES[stones], incline, rng)
