"""Positions and velocities of the joints, carried from step to step by one product."""

import numpy as np

from wam.model.constants import Array


class JointState:
    """Where the joints are and how fast, shapes (7,); semi-implicit Euler.

    Velocities stand half a step behind positions. The speed-dependent part of the
    dynamics takes them where the positions are, or a free swing loses energy.

    Attributes:
        rows: q [rad], qd [rad/s] and qd half a step on, shape (3, 7). A step makes
            new ones, so what was taken of the old ones stays as it was.
    """

    def __init__(self, q: Array, dt: float) -> None:
        """Rest at `q` [rad]; a step is `dt` [s] long."""
        # P (q, qd, qdd): q + dt (qd + dt qdd), qd + dt qdd, and dt / 2 later
        onward = [[1.0, dt, dt * dt], [0.0, 1.0, dt], [0.0, 1.0, 1.5 * dt]]
        self._P = np.array(onward)
        self.rest(q)

    def rest(self, q: Array) -> None:
        """Stand still at `q` [rad]."""
        self.rows = np.stack((q, np.zeros(7), np.zeros(7)))

    def move(self, q: Array) -> None:
        """Be at `q` [rad] with the velocities of now."""
        self.rows = np.stack((q, *self.rows[1:]))

    def step(self, qdd: Array) -> Array:
        """Go on by a step under `qdd` [rad/s^2]; return the new rows."""
        rows = self.rows
        rows[2] = qdd
        self.rows = rows = self._P.dot(rows)
        return rows
