"""The container around the ground: side boards that a careless foot runs into."""

import math

from fakes.ground.contact import DAMPING_MASS, Contact, Motion
from fakes.ground.terrain import Terrain

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
