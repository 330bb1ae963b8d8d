"""The operator's hand: carries the foot, puts it down, pushes it across.

Forces are in the terrain frame [N]; they act on the forearm at the hand point.
"""

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from fakes.randomness import NormalStream, OrnsteinUhlenbeck, Tremor

LIFT = 0.06  # how high the foot is carried above the plane [m]
SPEED = 0.25  # mean speed of carrying [m/s]
_CARRY_K, _CARRY_B = 800.0, 100.0  # N/m, N s/m
_LATERAL_K, _LATERAL_B = 400.0, 20.0
_PUSH_B = 18.0


class HandView(NamedTuple):
    """What the hand feels, terrain frame: sole and hand point [m], speeds [m/s]."""

    sole: tuple[float, float, float]
    sole_v: tuple[float, float, float]
    hand: tuple[float, float, float]
    hand_v: tuple[float, float, float]


class Phase(Enum):
    """What the hand is doing."""

    CARRY = auto()
    REST = auto()
    PUSH = auto()
    AWAY = auto()


@dataclass(frozen=True, slots=True)
class Pace:
    """How this operator pushes: speed [m/s], stiffness [N/m], strongest push [N]."""

    speed: float = 0.040
    stiffness: float = 300.0
    strongest: float = 22.0


class _Push:
    """One push: a spring to a target that moves with a wandering speed."""

    def __init__(
        self, pace: Pace, rng: np.random.Generator, view: HandView, dt: float
    ) -> None:
        n = NormalStream(rng)
        self._rng = rng
        self._pace = pace
        self._K = pace.stiffness * math.exp(0.15 * n.next())
        self._speed = pace.speed * math.exp(0.22 * n.next())
        self._beta = math.radians(4.0 + 6.0 * n.next())
        self._wander = OrnsteinUhlenbeck(0.25, 1.2, dt, n)
        self._effort = OrnsteinUhlenbeck(0.06, 0.4, dt, n)
        self._tilt = OrnsteinUhlenbeck(math.radians(9.0), 0.7, dt, n)
        self._press = OrnsteinUhlenbeck(0.8, 0.8, dt, n)
        self._tremor = Tremor(dt, n)
        self._n = n
        self._wait = float(rng.uniform(0.6, 1.0))
        self._age = 0.0
        self._x0 = view.hand[0]
        self._xe = 0.0
        self._z_ref = view.sole[2]
        self._strongest = pace.strongest
        self._progress_x = view.sole[0]
        self._progress_age = 0.0
        self._react_in: float | None = None
        self._react_force = 0.0
        self._deaf = 0.0

    def step(self, dt: float, view: HandView) -> tuple[float, float, float]:
        """Return the force on the hand point along x, y, z."""
        self._age += dt
        x = view.hand[0] - self._x0
        vx = view.hand_v[0]
        self._watch(dt, view)
        begun = min(max((self._age - self._wait) / 0.4, 0.0), 1.0)
        v_e = begun * self._speed * max(0.0, 1.0 + self._wander.step())
        spring = self._K * (self._xe - x)
        room = (self._strongest - spring) / (0.3 * self._strongest)
        self._xe += dt * v_e * min(max(room, 0.0), 1.0)
        self._react(dt, x, spring)
        force = spring + _PUSH_B * (v_e - vx)
        force += force * self._effort.step() * begun
        force += (0.05 + 0.012 * abs(force)) * self._tremor.step()
        force = max(force, -3.0)
        lateral = -_LATERAL_K * view.hand[1] - _LATERAL_B * view.hand_v[1]
        return force, lateral, -self._downward(dt, force, view, begun)

    def _downward(self, dt: float, force: float, view: HandView, begun: float) -> float:
        tilt = self._beta + self._tilt.step()
        tilt = min(max(tilt, math.radians(-5.0)), math.radians(40.0))
        z, vz = view.sole[2], view.sole_v[2]
        self._z_ref += dt * (z - self._z_ref) / 0.8
        wander = self._press.step() * begun
        pressed = max(force, 0.0) * math.tan(tilt)
        return pressed + wander + 18.0 * vz + 50.0 * (z - self._z_ref)

    def _watch(self, dt: float, view: HandView) -> None:
        """Press harder when stuck; notice a slip."""
        x, vx = view.sole[0], view.sole_v[0]
        if x - self._progress_x > 0.006:
            self._progress_x, self._progress_age = x, 0.0
            self._strongest = self._pace.strongest
        else:
            self._progress_age += dt
            if self._progress_age > 1.5:
                self._strongest = min(self._strongest + 3.0 * dt, 40.0)
        self._deaf = max(self._deaf - dt, 0.0)
        if vx > 0.12 and self._deaf == 0.0 and self._react_in is None:
            self._react_in = max(0.1, 0.18 + 0.03 * self._n.next())

    def _react(self, dt: float, x: float, spring: float) -> None:
        """After a slip, and a reaction time, let the target go back."""
        if self._react_in is None:
            self._react_force = spring
            return
        self._react_in -= dt
        if self._react_in <= 0.0:
            share = float(self._rng.uniform(0.1, 0.5))
            self._xe = x + share * max(self._react_force, 0.0) / self._K
            self._react_in = None
            self._deaf = 0.25


class Hand:
    """Does what it is told, with forces a person could exert."""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self.phase = Phase.CARRY
        self._start: tuple[float, float, float] | None = None
        self._path: list[tuple[float, float, float]] = []
        self._moved = 0.0
        self._push: _Push | None = None
        self._pending: tuple[Pace, np.random.Generator] | None = None
        self._anchor: float | None = None

    @property
    def is_done(self) -> bool:
        """Whether the last carrying has come to its end."""
        return self.phase is not Phase.CARRY or not self._path

    @property
    def is_holding(self) -> bool:
        """Whether the hand is on the arm."""
        return self.phase is not Phase.AWAY

    def carry(self, *points: tuple[float, float, float]) -> None:
        """Carry the sole through `points` (terrain frame) and hold it there."""
        self.phase = Phase.CARRY
        self._path = list(points)
        self._start = None

    def lift_to_start(self) -> None:
        """Lift the foot, carry it above the far end and hold it still."""
        self.carry((math.nan, 0.0, LIFT), (0.0, 0.0, LIFT))

    def put_down(self, ground: float) -> None:
        """Lower the foot onto the ground at the far end and let it rest there."""
        self.carry((0.0, 0.0, ground + 0.01), (0.0, 0.0, ground - 0.002))
        self.phase = Phase.CARRY
        self._path.append((math.nan, math.nan, math.nan))  # then rest

    def push(self, pace: Pace, rng: np.random.Generator) -> None:
        """Push the foot across the container."""
        self._pending = (pace, rng)

    def let_go(self) -> None:
        """Take the hand away."""
        self.phase = Phase.AWAY

    def step(self, view: HandView) -> tuple[float, float, float]:
        """Return the force on the hand point along x, y, z of the terrain frame."""
        if self._pending is not None:
            self._push = _Push(*self._pending, view, self._dt)
            self._pending = None
            self.phase = Phase.PUSH
        if self.phase is Phase.PUSH and self._push is not None:
            return self._push.step(self._dt, view)
        if self.phase is Phase.CARRY:
            return self._carry_force(view)
        if self.phase is Phase.REST:
            return self._rest_force(view)
        return 0.0, 0.0, 0.0

    def _rest_force(self, view: HandView) -> tuple[float, float, float]:
        x, vx = view.sole[0], view.sole_v[0]
        if self._anchor is None:
            self._anchor = x
        along = 300.0 * (self._anchor - x) - _PUSH_B * vx
        across = -_LATERAL_K * view.hand[1] - _LATERAL_B * view.hand_v[1]
        return along, across, -18.0 * view.sole_v[2]

    def _carry_force(self, view: HandView) -> tuple[float, float, float]:
        if self._start is None:
            self._start = view.sole
            self._moved = 0.0
        if self._path and math.isnan(self._path[0][2]):
            self._path.clear()
            self._anchor = None
            self.phase = Phase.REST
            return self._rest_force(view)
        target, velocity = self._target()
        return (
            _spring(target[0], velocity[0], view.sole[0], view.sole_v[0]),
            _spring(target[1], velocity[1], view.sole[1], view.sole_v[1]),
            _spring(target[2], velocity[2], view.sole[2], view.sole_v[2]),
        )

    def _target(
        self,
    ) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return (position, velocity) on a minimum-jerk path to the next point."""
        assert self._start is not None
        if not self._path:
            return self._start, (0.0, 0.0, 0.0)
        start = self._start
        goal = self._path[0]
        if math.isnan(goal[0]):
            goal = (start[0], goal[1], goal[2])
        step = (goal[0] - start[0], goal[1] - start[1], goal[2] - start[2])
        duration = max(math.hypot(*step) / SPEED, 0.4)
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
