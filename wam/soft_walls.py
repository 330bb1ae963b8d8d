"""Soft walls: before a joint stop a spring pushes back and a damper brakes.

From 0.1 rad inside the stop the spring grows to half the joint's torque limit at the
stop itself. A wall is there only once the joint has been in front of it: the home
position lies on or past two stops, and an arm that starts there is not thrown off.
"""

from dataclasses import dataclass

import numpy as np

from acquisition.devices import Vector

DEPTH = 0.1  # rad
_REACH = 0.2  # rad in which the spring would reach the torque limit
_ALL = (1 << 7) - 1


@dataclass(frozen=True, slots=True)
class Walls:
    """Where the walls are and how strong.

    Attributes:
        lower: lower stops [rad], seven.
        upper: upper stops [rad], seven.
        torque: torque limits [N m], seven; a wall gives half of it at the stop.
        damping: dampers [N m s/rad], seven, against motion into the wall.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    torque: tuple[float, ...]
    damping: tuple[float, ...]


class SoftWalls:
    """The walls of seven joints; remembers which ones have been armed."""

    def __init__(self, walls: Walls) -> None:
        self._walls = walls
        self._armed = 0

    @property
    def limits(self) -> tuple[float, ...]:
        """The torque limits of the joints [N m], seven."""
        return self._walls.torque

    def torque(self, q: Vector, qd: Vector) -> Vector | None:
        """Return what the walls add at `q` [rad] and `qd` [rad/s], shapes (7,).

        None stands for nothing at all, which is nearly always.

        Returns:
            Torques [N m], shape (7,), never larger than the torque limits.
        """
        walls = self._walls
        pushed: dict[int, float] = {}
        rows = zip(q.tolist(), walls.lower, walls.upper, strict=True)
        for joint, (angle, lower, upper) in enumerate(rows):
            depth = max(lower + DEPTH - angle, 0.0) - max(angle - upper + DEPTH, 0.0)
            if depth == 0.0:
                self._armed |= 1 << joint
            elif self._armed >> joint & 1:
                pushed[joint] = self._push(joint, depth, float(qd[joint]))
        if not pushed:
            return None
        tau = np.zeros(7)
        for joint, push in pushed.items():
            tau[joint] = push
        return tau

    def _push(self, joint: int, depth: float, speed: float) -> float:
        """Return the torque of one wall; `depth` > 0 lies at the lower stop."""
        walls = self._walls
        limit = walls.torque[joint]
        inward = 1.0 if depth > 0.0 else -1.0
        spring = limit / _REACH * abs(depth)
        brake = walls.damping[joint] * max(-inward * speed, 0.0)
        # The damper comes in with the spring, or touching the wall would be a blow.
        share = min(abs(depth) / DEPTH, 1.0)
        return inward * min(spring + share * brake, limit)
