"""A foot on the ground: motion in, force out, and what plates and stones share.

Everything is in the terrain frame: x along the slip direction from the far end, z out
of the ground. Forces are those of the ground on the foot, F_t against x.
"""

import math
from typing import NamedTuple

import numpy as np

DAMPING_MASS = 3.5  # mass that the normal damping ratio refers to [kg]


class Contact(NamedTuple):
    """Force of the ground on the foot [N]: against x, along y, along z."""

    F_t: float
    F_y: float
    F_n: float


class Motion(NamedTuple):
    """Sole in the terrain frame: position [m] and velocity [m/s]."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


NO_CONTACT = Contact(0.0, 0.0, 0.0)


class LateralBristle:
    """Elastic-plastic bristle in y: stiffness [N/m], limit [N] set at each step."""

    def __init__(self, stiffness: float) -> None:
        self._stiffness = stiffness
        self._anchor: float | None = None

    def release(self) -> None:
        """Lose contact."""
        self._anchor = None

    def step(self, y: float, limit: float) -> float:
        """Return the force along y [N]."""
        if self._anchor is None:
            self._anchor = y
        force = self._stiffness * (self._anchor - y)
        if abs(force) > limit:
            force = math.copysign(limit, force)
            self._anchor = y + force / self._stiffness
        return force


GRID = 0.001  # spacing of the tabulated profiles [m]
_MARGIN = 0.2  # the tables begin this far before the far end [m]
_POINTS = 1200


def smooth_profile(rng: np.random.Generator, length: float) -> np.ndarray:
    """Return unit-variance Gaussian noise of correlation `length` [m] on the grid."""
    reach = max(int(4.0 * length / GRID), 1)
    taps = np.exp(-(((np.arange(-reach, reach + 1) * GRID) / length) ** 2))
    noise = rng.standard_normal(_POINTS + 2 * reach)
    return np.convolve(noise, taps / np.sqrt((taps**2).sum()), "valid")


def height_at(table: np.ndarray, x: float) -> float:
    """Return a tabulated profile at `x` [m], linear between the points."""
    position = min(max((x + _MARGIN) / GRID, 0.0), _POINTS - 1.001)
    i = int(position)
    share = position - i
    return float(table[i]) * (1.0 - share) + float(table[i + 1]) * share
