"""A person's hands on the links: they bring the joints to angles and hold them there.

At each joint a spring and a damper pull to where the hands want it to be, never more
strongly than a person is; they bear whatever weight the motors do not.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

import numpy as np

from acquisition.clock import PERIOD_NS
from fakes.plant.joints import STOP_K, GripTorques
from wam.model.constants import Array

Side = Literal["low", "high"]

_DT = PERIOD_NS * 1e-9  # s
_K = np.array([4000.0, 4000.0, 2000.0, 2000.0, 300.0, 300.0, 60.0])  # N m/rad
_B = np.array([60.0, 60.0, 30.0, 30.0, 3.0, 3.0, 0.4])  # N m s/rad
_STRONGEST = np.array([80.0, 80.0, 50.0, 50.0, 10.0, 10.0, 4.0])  # N m
_BEARS = np.array([2.0, 2.0, 2.0, 2.0, 0.5, 0.5, 0.2])  # of a stop that is felt [N m]
_GIVE = _BEARS * (1.0 / STOP_K + 1.0 / _K)  # of stop and hands where it is felt [rad]
_TURN, _FEEL, _NEAR = 1.0, 0.12, 0.2  # rad/s on the way, near a stop; how near [rad]
_QUICKEST = 0.1  # s, of any pose


class Ends(NamedTuple):
    """Where the joints really end: stops [rad], shapes (7,)."""

    lower: Array
    upper: Array


class Way(Protocol):
    """Where hands want the joints to be, cycle by cycle."""

    @property
    def is_done(self) -> bool:
        """Whether it has come to its end."""
        ...

    def begin(self, q: Array) -> None:
        """Begin where the joints are, `q` [rad], shape (7,)."""
        ...

    def go_on(self, q: Array) -> tuple[Array, Array]:
        """Go on by a cycle from joints at `q`; return (angles, speeds), shapes (7,)."""
        ...


class PoseWay:
    """A minimum-jerk way of all joints to a goal."""

    def __init__(self, goal: Sequence[float], seconds: float, ends: Ends) -> None:
        """Take the `goal` [rad], seven; a stop lets no joint further than it gives."""
        wanted = np.array(goal, dtype=np.float64)
        self._goal = np.clip(wanted, ends.lower - _GIVE, ends.upper + _GIVE)
        self._seconds = max(seconds, _QUICKEST)
        self._start, self._moved = self._goal, 0.0

    @property
    def is_done(self) -> bool:
        """Whether the goal is where the joints are wanted."""
        return self._moved >= self._seconds

    def begin(self, q: Array) -> None:
        """Begin at `q` [rad], shape (7,)."""
        self._start = q.copy()

    def go_on(self, q: Array) -> tuple[Array, Array]:
        """Go on by a cycle; return (angles, speeds) that are wanted, shapes (7,)."""
        del q
        self._moved = min(self._moved + _DT, self._seconds)
        s, way = self._moved / self._seconds, self._goal - self._start
        share = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
        rate = 30.0 * s * s * (1.0 - s) ** 2 / self._seconds
        return self._start + share * way, rate * way


class StopWay:
    """One joint turned until its stop bears; the others are held where they are."""

    def __init__(self, joint: int, side: Side, ends: Ends) -> None:
        """Take a joint, 1-7, and which of its stops is meant."""
        self._i = joint - 1
        self._sign = 1.0 if side == "high" else -1.0
        self._stop = float((ends.upper if side == "high" else ends.lower)[self._i])
        self._wanted, self._speed, self._is_felt = np.zeros(7), 0.0, False

    @property
    def is_done(self) -> bool:
        """Whether the stop is felt."""
        return self._is_felt

    def begin(self, q: Array) -> None:
        """Begin at `q` [rad], shape (7,)."""
        self._wanted = q.copy()

    def go_on(self, q: Array) -> tuple[Array, Array]:
        """Go on by a cycle; return (angles, speeds) that are wanted, shapes (7,)."""
        i, rates = self._i, np.zeros(7)
        beyond = self._sign * (q[i] - self._stop)
        self._is_felt = self._is_felt or bool(beyond * STOP_K >= _BEARS[i])
        if self._is_felt:
            return self._wanted, rates
        fastest = _FEEL if beyond > -_NEAR else _TURN
        self._speed = min(self._speed + 2.0 * _DT, fastest)  # gently: 2 rad/s^2
        lead = self._sign * (self._wanted[i] - q[i])
        if lead * _K[i] < _STRONGEST[i]:
            rates[i] = self._sign * self._speed
            self._wanted[i] += _DT * rates[i]
        return self._wanted, rates


class JointGrip:
    """Hands on the links that follow a way."""

    def __init__(self, way: Way) -> None:
        self._way = way
        self._has_begun = False

    @property
    def is_done(self) -> bool:
        """Whether the way has come to its end; the joints are held there."""
        return self._way.is_done

    def step(self, q: Array, bears: Array) -> GripTorques:
        """Return what the hands do in a cycle.

        Args:
            q: joint positions [rad], shape (7,).
            bears: torques that carry what no motor does [N m], shape (7,).
        """
        if not self._has_begun:
            self._way.begin(q)
            self._has_begun = True
        wanted, rates = self._way.go_on(q)
        return GripTorques(bears + _B * rates, _K, _B, wanted.copy(), _STRONGEST)
