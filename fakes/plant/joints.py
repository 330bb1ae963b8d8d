"""What resists the joints: dry and viscous friction, and the stops."""

import math
from collections.abc import Sequence
from struct import Struct
from typing import NamedTuple

import numpy as np

from wam.model import ArmConstants, Array, drive_inertia_matrix

_STOP_K, _STOP_B = 2000.0, 20.0  # N m/rad, N m s/rad
_EPSILON = 0.01  # rad/s, where Coulomb friction saturates
_STANDSTILL = 1e-9  # rad/s, keeps the secant finite
_NEAR = 0.05  # of a stop: no joint goes further in 2 ms [rad]


class Resistance(NamedTuple):
    """What resists the joints at one place and speed; seven numbers of each.

    Attributes:
        inertias: drive inertia + dt D [kg m^2].
        damping: D [N m s/rad].
        springs: with which the stops push back [N m].
        is_near_stop: a joint may be at a stop within a cycle.
    """

    inertias: list[float]
    damping: list[float]
    springs: list[float]
    is_near_stop: bool


class JointResistance:
    """Resistance of the seven joints as damping, which an implicit step can take.

    D = diag(c tanh(|qd| / 0.01) / |qd| + viscous) is the secant of dry friction. Taken
    explicitly it is beyond stability for joint 7; so would be the damping of its stop.
    """

    def __init__(self, constants: ArmConstants, friction: float, dt: float) -> None:
        """Take the arm and the step.

        Args:
            constants: of the arm; its drives' inertia counts.
            friction: share of the figures identified on another arm.
            dt: length of a step [s].
        """
        self._dt = dt
        self._joints: list[tuple[float, float, float, float, float]] = list(
            zip(
                np.diag(drive_inertia_matrix(constants)).tolist(),
                (friction * constants.coulomb).tolist(),
                (friction * constants.viscous).tolist(),
                constants.q_lower.tolist(),
                constants.q_upper.tolist(),
                strict=True,
            )
        )

    def at(self, q: Sequence[float], qd: Sequence[float]) -> Resistance:
        """Return what resists the joints.

        Args:
            q: joint positions [rad].
            qd: joint velocities [rad/s].
        """
        inertias: list[float] = []
        dampings: list[float] = []
        springs = [0.0] * 7
        is_near_stop = False
        for i, (angle, rate, joint) in enumerate(zip(q, qd, self._joints, strict=True)):
            drive, dry, damping, lower, upper = joint
            speed = abs(rate) + _STANDSTILL
            damping += dry * math.tanh(speed / _EPSILON) / speed
            if not lower + _NEAR <= angle <= upper - _NEAR:
                is_near_stop = True
                beyond = max(angle - upper, 0.0) - max(lower - angle, 0.0)
                springs[i] = -_STOP_K * beyond
                damping += _STOP_B if beyond else 0.0
            dampings.append(damping)
            inertias.append(drive + self._dt * damping)
        return Resistance(inertias, dampings, springs, is_near_stop)


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


_LAYOUT = Struct("26d")  # wrench on foot and hand, joint velocities, driving torques


class JointLoads:
    """Turns wrenches on foot and hand, motion and torques into torques of the joints.

    Attributes:
        A: rows that give the sole's velocity, the foot's turn, the hand's velocity and
            turn from the joint velocities, shape (12, 7); to be filled in place.
    """

    def __init__(self) -> None:
        self._B = np.vstack((np.zeros((12, 7)), np.zeros((7, 7)), np.eye(7)))
        self.A = self._B[:12]
        self._resisting = self._B[12:19].reshape(-1)[:: 7 + 1]  # the diagonal of -D
        self._buffer = bytearray(_LAYOUT.size)
        self._loads = np.frombuffer(self._buffer)

    def resist(self, damping: Sequence[float]) -> None:
        """Let the joints be damped by `damping` [N m s/rad], seven, from now on."""
        np.negative(damping, out=self._resisting)

    def torques(
        self,
        wrench: Sequence[float],
        qd: Sequence[float],
        driving: Sequence[float],
    ) -> Array:
        """Return A^T `wrench` - D `qd` + `driving` [N m], shape (7,).

        Args:
            wrench: on foot and hand, twelve numbers in the order of the rows of A.
            qd: joint velocities [rad/s], seven.
            driving: torques that drive the joints [N m], seven.
        """
        _LAYOUT.pack_into(self._buffer, 0, *wrench, *qd, *driving)
        return self._loads.dot(self._B)
