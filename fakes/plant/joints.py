"""What resists the joints: dry and viscous friction, and the stops."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wam.model.arm_model import drive_inertia_matrix
from wam.model.constants import ArmConstants

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
