"""The ground of one trial: a plate or a bed of stones, and the boards around it."""

import math
from typing import Protocol

import numpy as np

from fakes.ground.contact import DAMPING_MASS, Contact, Motion
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


FREE = 0.045  # from the centre line until the sole's edge meets a board [m]
_RIM = 0.04  # height of the boards above the plane [m]
_K = 5000.0  # N/m
_B = 2.0 * 0.4 * math.sqrt(_K * DAMPING_MASS)  # N s/m
_MU = 0.3  # of a rubbing foot


class Container:
    """A ground between two boards; both push, neither pulls."""

    def __init__(self, ground: Terrain) -> None:
        self.ground = ground

    @property
    def stiffness(self) -> float:
        """Normal stiffness of the ground [N/m]."""
        return self.ground.stiffness

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed ground at `x` [m]."""
        return self.ground.surface(x)

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return self.ground.truth()

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the ground by `dt` [s]; return what it and the boards do."""
        contact = self.ground.step(dt, motion)
        if -FREE <= motion[1] <= FREE:
            return contact
        _, y, z, vx, vy, _, _, _, _ = motion
        if z > _RIM:
            return contact
        depth = abs(y) - FREE
        side = math.copysign(1.0, y)
        shared = max(0.0, _K * depth + _B * side * vy)
        rubbing = _MU * shared * math.tanh(vx / 0.01)
        F_t, F_y, F_n, M_x, M_y, M_z = contact
        return F_t + rubbing, F_y - side * shared, F_n, M_x, M_y, M_z
