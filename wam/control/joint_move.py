"""A straight line in joint space with a trapezoidal speed, followed by joint PD."""

from dataclasses import dataclass

import numpy as np

from wam.model import Array

TOP_SPEED = 0.5  # rad/s
ACCELERATION = 0.5  # rad/s^2
TORQUE_LIMIT = np.array([25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0])  # N m, PD part only


@dataclass(frozen=True, slots=True)
class JointMove:
    """A move from `start` to `goal` [rad], shapes (7,).

    The joint that has furthest to go moves with the trapezoid; the others follow in
    proportion, so the line is straight.
    """

    start: Array
    goal: Array
    speed: float = TOP_SPEED
    acceleration: float = ACCELERATION

    @property
    def duration(self) -> float:
        """Time from rest to rest [s]."""
        length = self._length
        if length * self.acceleration < self.speed**2:  # the speed is never reached
            return 2.0 * float(np.sqrt(length / self.acceleration))
        return length / self.speed + self.speed / self.acceleration

    def at(self, t: float) -> tuple[Array, Array]:
        """Return (positions [rad], velocities [rad/s]) `t` seconds after the start."""
        length, T, a = self._length, self.duration, self.acceleration
        if length == 0.0 or t >= T:
            return self.goal.copy(), np.zeros(7)
        ramp = min(self.speed / a, T / 2.0)
        if t <= 0.0:
            s, v = 0.0, 0.0
        elif t < ramp:
            s, v = 0.5 * a * t * t, a * t
        elif t <= T - ramp:
            s, v = a * ramp * (t - 0.5 * ramp), a * ramp
        else:
            left = T - t
            s, v = length - 0.5 * a * left * left, a * left
        direction = (self.goal - self.start) / length
        return self.start + s * direction, v * direction

    @property
    def _length(self) -> float:
        return float(np.abs(self.goal - self.start).max())


def joint_pd(kp: Array, kd: Array, error: Array, rate_error: Array) -> Array:
    """Return kp e + kd de [N m], shape (7,), clipped to the limits of the PD part."""
    return np.clip(kp * error + kd * rate_error, -TORQUE_LIMIT, TORQUE_LIMIT)
