"""What resists the joints: dry and viscous friction, and the stops."""

import math
from collections.abc import Sequence

import numpy as np

from wam.constants import ArmConstants
from wam.model import drive_inertia_matrix

_STOP_K, _STOP_B = 2000.0, 20.0  # N m/rad, N m s/rad
_EPSILON = 0.01  # rad/s, where Coulomb friction saturates
_STANDSTILL = 1e-9  # rad/s, keeps the secant finite


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

    def at(
        self, q: Sequence[float], qd: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Return (drive inertia + dt D [kg m^2], torques [N m]), seven each.

        The torques are those of the stops and -D qd.

        Args:
            q: joint positions [rad].
            qd: joint velocities [rad/s].
        """
        inertias: list[float] = []
        torques: list[float] = []
        dt, tanh = self._dt, math.tanh
        add_inertia, add_torque = inertias.append, torques.append
        for angle, rate, joint in zip(q, qd, self._joints, strict=True):
            drive, dry, damping, lower, upper = joint
            speed = (rate if rate > 0.0 else -rate) + _STANDSTILL
            damping += dry * tanh(speed / _EPSILON) / speed
            if lower <= angle <= upper:
                add_torque(-damping * rate)
            else:
                damping += _STOP_B
                beyond = angle - (lower if angle < lower else upper)
                add_torque(-_STOP_K * beyond - damping * rate)
            add_inertia(drive + dt * damping)
        return inertias, torques
