"""The operator's hand: carries the foot, puts it down, pushes it across the container.

Forces are in the terrain frame [N] and act on the forearm at the hand point.
"""

import math
from enum import Enum, auto

import numpy as np

from acquisition.simulation import ENDS
from fakes.plant.grip import JointGrip
from fakes.plant.push import (
    LATERAL_B,
    LATERAL_K,
    PUSH_B,
    PUSH_K,
    HandView,
    Pace,
    Push,
    Vector3,
)

LIFT = 0.06  # height of the carried foot above the plane [m]
SPEED = 0.25  # mean speed of carrying [m/s]
_CAREFUL = 0.12  # m/s, while touching corners
_CARRY_K, _CARRY_B = 800.0, 100.0  # N/m, N s/m
_REST_B = 18.0  # damping of a resting hand along z [N s/m]


_ASIDE = 0.035  # lateral distance of a touched corner from the centre line [m]


def touched_point(number: int, travel: float) -> tuple[float, float]:
    """Return the position (x, y) of touch `number` on the container [m].

    1 to 4: its corners; above `ENDS`: the middle of its ends, the near one first.
    """
    if number > ENDS:
        return (travel if number % 2 else 0.0), 0.0
    if number <= 4:
        return (0.0 if number <= 2 else travel), (-_ASIDE if number % 2 else _ASIDE)
    share = number * 0.618 % 1.0  # spreads out, whatever the number
    return share * travel, _ASIDE * (2.0 * (number * 0.383 % 1.0) - 1.0)


class HandPhase(Enum):
    """Activity of the hand."""

    CARRY = auto()
    REST = auto()
    PUSH = auto()
    POSE = auto()
    AWAY = auto()


class Hand:
    """The operator's hand, with forces that a person can exert."""

    def __init__(self, dt: float, *, is_there: bool = True) -> None:
        self._dt = dt
        self.phase = HandPhase.CARRY if is_there else HandPhase.AWAY
        self._start: Vector3 | None = None
        self._path: list[Vector3] = []
        self._moved = 0.0
        self._speed = SPEED
        self._push: Push | None = None
        self._grip: JointGrip | None = None
        self._pending: tuple[Pace, np.random.Generator] | None = None
        self._anchor = 0.0
        self._rests_then = False

    @property
    def is_done(self) -> bool:
        """Whether the last motion has ended."""
        if (grip := self.grip) is not None:
            return grip.is_done
        return self.phase is not HandPhase.CARRY or not self._path

    @property
    def is_holding(self) -> bool:
        """Whether the hand is on the arm."""
        return self.phase is not HandPhase.AWAY

    @property
    def grip(self) -> JointGrip | None:
        """Two hands on the links; None = not there."""
        return self._grip if self.phase is HandPhase.POSE else None

    def carry(self, *points: Vector3) -> None:
        """Carry the sole through `points` (terrain frame) and hold it there."""
        self.phase = HandPhase.CARRY
        self._speed = SPEED
        self._path = list(points)
        self._start = None
        self._rests_then = False

    def lift_to_start(self) -> None:
        """Lift the foot, carry it above the far end and hold it still."""
        self.carry((math.nan, 0.0, LIFT), (0.0, 0.0, LIFT))

    def put_down(self, ground: float) -> None:
        """Lower the foot onto the ground at the far end and let it rest there."""
        self.carry((0.0, 0.0, ground + 0.01), (0.0, 0.0, ground - 0.002))
        self._rests_then = True

    def touch(self, x: float, y: float, ground: float) -> None:
        """Carry the foot above a point, lower it there, and press lightly."""
        above, low = (x, y, LIFT), (x, y, ground + 0.01)
        self.carry((math.nan, math.nan, LIFT), above, low, (x, y, ground - 0.004))
        self._speed = _CAREFUL

    def push(self, pace: Pace, rng: np.random.Generator) -> None:
        """Push the foot across the container."""
        self._pending = (pace, rng)

    def rest(self) -> None:
        """Stop and rest on the arm."""
        self.carry()
        self._rests_then = True

    def hold_links(self, grip: JointGrip) -> None:
        """Grasp the links with two hands that follow `grip`."""
        self.phase = HandPhase.POSE
        self._grip = grip

    def let_go(self) -> None:
        """Release the arm."""
        self.phase = HandPhase.AWAY

    def step(self, view: HandView) -> Vector3:
        """Return the force on the hand point along x, y, z of the terrain frame."""
        if self._pending is not None:
            self._push = Push(*self._pending, view, self._dt)
            self._pending = None
            self.phase = HandPhase.PUSH
        phase = self.phase
        if phase is HandPhase.PUSH and self._push is not None:
            return self._push.step(view)
        if phase is HandPhase.CARRY:
            return self._carry_force(view)
        if phase is HandPhase.REST:
            return self._rest_force(view)
        return 0.0, 0.0, 0.0

    def _rest_force(self, view: HandView) -> Vector3:
        (x, y, _), (vx, vy, vz) = view.hand, view.hand_v
        along = PUSH_K * (self._anchor - x) - PUSH_B * vx
        return along, -LATERAL_K * y - LATERAL_B * vy, -_REST_B * vz

    def _carry_force(self, view: HandView) -> Vector3:
        if self._start is None:
            self._start = view.sole
            self._moved = 0.0
        if self._rests_then and not self._path:
            self._anchor = view.hand[0]
            self.phase = HandPhase.REST
            return self._rest_force(view)
        target, velocity = self._target()
        return (
            _spring(target[0], velocity[0], view.sole[0], view.sole_v[0]),
            _spring(target[1], velocity[1], view.sole[1], view.sole_v[1]),
            _spring(target[2], velocity[2], view.sole[2], view.sole_v[2]),
        )

    def _target(self) -> tuple[Vector3, Vector3]:
        """Return (position, velocity) on a minimum-jerk path to the next point."""
        assert self._start is not None
        if not self._path:
            return self._start, (0.0, 0.0, 0.0)
        start = self._start
        goal = self._path[0]
        if math.isnan(goal[0]):
            goal = (start[0], start[1] if math.isnan(goal[1]) else goal[1], goal[2])
        step = (goal[0] - start[0], goal[1] - start[1], goal[2] - start[2])
        duration = max(math.hypot(*step) / self._speed, 0.4)
        self._moved += self._dt
        s = min(self._moved / duration, 1.0)
        share = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
        rate = 30.0 * s * s * (1.0 - s) ** 2 / duration
        if s >= 1.0:
            self._start = goal
            self._path.pop(0)
            self._moved = 0.0
        position = (
            start[0] + share * step[0],
            start[1] + share * step[1],
            start[2] + share * step[2],
        )
        return position, (rate * step[0], rate * step[1], rate * step[2])


def _spring(target: float, velocity: float, x: float, v: float) -> float:
    return _CARRY_K * (target - x) + _CARRY_B * (velocity - v)
