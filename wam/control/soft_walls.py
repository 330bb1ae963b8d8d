"""Soft walls: a spring and a damper before each joint stop.

From 0.1 rad before the stop the spring grows to half the joint's torque limit at the
stop. A wall is armed once the joint has been in front of it: the home position lies on
or past two stops, and an arm that starts there must not be thrown off.
"""

from dataclasses import dataclass

import numpy as np

from acquisition.bounds import are_between
from acquisition.devices import ArmReading, Vector

DEPTH = 0.1  # rad
_FULL_DEPTH = 0.2  # rad in which the spring would reach the torque limit
# Walls stay below the torque limit: beyond it the guard would stop the arm and report a
# wrong mass of the foot.
_SHARE = 0.95  # of the torque limit
_ALL_ARMED = 0x7F


@dataclass(frozen=True, slots=True)
class Walls:
    """Positions and gains of the walls, seven values each.

    Attributes:
        lower: lower stops [rad].
        upper: upper stops [rad].
        torque: torque limits [N m]; the spring gives half of it at the stop.
        damping: damping of motion into the wall [N m s/rad].
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    torque: tuple[float, ...]
    damping: tuple[float, ...]


class SoftWalls:
    """Soft walls of seven joints, each armed once its joint has been in front of it."""

    def __init__(self, walls: Walls) -> None:
        self._walls = walls
        self._lower = [lower + DEPTH for lower in walls.lower]
        self._upper = [upper - DEPTH for upper in walls.upper]
        self._bounds = np.array((self._lower, self._upper))
        self._armed = 0

    @property
    def limits(self) -> tuple[float, ...]:
        """The torque limits of the joints [N m], seven."""
        return self._walls.torque

    def depth(self, q: Vector) -> Vector | None:
        """Return the depths in the walls [rad], (7,), positive at lower stops.

        None if no joint is inside a wall.
        """
        if are_between(self._lower, q.tolist(), self._upper):
            return None
        lower, upper = self._bounds
        return np.maximum(lower - q, 0.0) - np.maximum(q - upper, 0.0)

    def apply(self, tau: Vector, reading: ArmReading) -> None:
        """Add the wall torques to `tau` [N m], shape (7,), within the torque limits."""
        # An extrapolated position arms nothing.
        may_arm = reading.is_complete and self._armed != _ALL_ARMED
        q = reading.q.tolist()
        if not may_arm and are_between(self._lower, q, self._upper):
            return
        rows = zip(q, self._lower, self._upper, strict=True)
        for joint, (angle, lower, upper) in enumerate(rows):
            if lower <= angle <= upper:
                if may_arm:
                    self._armed |= 1 << joint
                continue
            depth = max(lower - angle, 0.0) - max(angle - upper, 0.0)
            if self._armed >> joint & 1:
                push = self._push(joint, depth, float(reading.qd[joint]))
                tau[joint] = self._bounded(joint, float(tau[joint]), push)

    def _push(self, joint: int, depth: float, speed: float) -> float:
        """Return the torque of one wall [N m]; `depth` > 0 means the lower stop."""
        walls = self._walls
        limit = walls.torque[joint]
        inward = 1.0 if depth > 0.0 else -1.0
        spring = limit / _FULL_DEPTH * abs(depth)
        brake = walls.damping[joint] * max(-inward * speed, 0.0)
        # The damper grows with the depth: full damping at contact would be an impact.
        share = min(abs(depth) / DEPTH, 1.0)
        return inward * (spring + share * brake)

    def _bounded(self, joint: int, tau: float, push: float) -> float:
        """Return `tau` plus `push`, with the push limited to the joint's limit."""
        limit = _SHARE * self._walls.torque[joint]
        if push > 0.0:
            return max(tau, min(tau + push, limit))
        return min(tau, max(tau + push, -limit))
