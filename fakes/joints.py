"""What resists the joints: dry and viscous friction, and the stops."""

import math
from collections.abc import Sequence

from wam.constants import ArmConstants

_STOP_K, _STOP_B = 2000.0, 20.0  # N m/rad, N m s/rad
_EPSILON = 0.01  # rad/s, where Coulomb friction saturates
_STANDSTILL = 1e-9  # rad/s, keeps the secant finite


class JointResistance:
    """Resistance of the seven joints as damping, which an implicit step can take.

    D = diag(c tanh(|qd| / 0.01) / |qd| + viscous) is the secant of dry friction. Taken
    explicitly it is beyond stability for joint 7; so would be the damping of its stop.
    """

    def __init__(self, constants: ArmConstants, friction: float) -> None:
        """Take `friction` as a share of the figures identified on another arm."""
        self._joints: list[tuple[float, float, float, float]] = list(
            zip(
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
        """Return (D [N m s/rad], torques [N m]), seven each.

        The torques are those of the stops and -D qd.

        Args:
            q: joint positions [rad].
            qd: joint velocities [rad/s].
        """
        dampings: list[float] = []
        torques: list[float] = []
        for angle, rate, joint in zip(q, qd, self._joints, strict=True):
            dry, damping, lower, upper = joint
            torque = 0.0
            if dry:
                speed = abs(rate) + _STANDSTILL
                damping += dry * math.tanh(speed / _EPSILON) / speed
            if not lower <= angle <= upper:
                torque = _STOP_K * ((lower if angle < lower else upper) - angle)
                damping += _STOP_B
            dampings.append(damping)
            torques.append(torque - damping * rate)
        return dampings, torques
