"""A foot on the ground: motion in, force out.

Everything is in the terrain frame: x along the slip direction from the far end, z out
of the ground. Forces are those of the ground on the foot, F_t against x.
"""

from typing import NamedTuple

DAMPING_MASS = 3.5  # mass that the normal damping ratio refers to [kg]


class Contact(NamedTuple):
    """What the ground does to the foot.

    Force [N] against x, along y, along z; moment about the centre of the sole [N m].
    """

    F_t: float
    F_y: float
    F_n: float
    M_x: float = 0.0
    M_y: float = 0.0
    M_z: float = 0.0


class Motion(NamedTuple):
    """Sole in the terrain frame: position [m], velocity [m/s], turning rate [rad/s]."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    wx: float = 0.0
    wy: float = 0.0
    wz: float = 0.0


NO_CONTACT = Contact(0.0, 0.0, 0.0)
