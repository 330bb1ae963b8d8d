"""A person's hands on the links that bring the joints to a pose and hold them.

At each joint a spring and a damper pull towards the hands' reference, limited to a
person's strength; the hands support the weight that the motors do not.
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
# Torque of a stop that a person notices [N m], and deflection of stop and hands [rad]
_NOTICED_TORQUE = np.array([2.0, 2.0, 2.0, 2.0, 0.5, 0.5, 0.2])
_GIVE = _NOTICED_TORQUE * (1.0 / STOP_K + 1.0 / _K)
_TURN, _FEEL, _NEAR = 1.0, 0.12, 0.2  # rad/s free, rad/s near a stop; distance [rad]
_QUICKEST = 0.1  # s; shortest motion to a pose


class StopAngles(NamedTuple):
    """True joint stops [rad], shapes (7,)."""

    lower: Array
    upper: Array


class JointPath(Protocol):
    """Reference path of the hands, cycle by cycle."""

    @property
    def is_done(self) -> bool:
        """Whether the path has ended."""
        ...

    def begin(self, q: Array) -> None:
        """Begin at joint positions `q` [rad], shape (7,)."""
        ...

    def advance(self, q: Array) -> tuple[Array, Array]:
        """Advance by a cycle with joints at `q`; return (angles, speeds), (7,) each."""
        ...


class PosePath:
    """A minimum-jerk path of all joints to a goal."""

    def __init__(self, goal: Sequence[float], seconds: float, ends: StopAngles) -> None:
        """Set the `goal` [rad], seven, clipped to the stops plus their deflection."""
        joints = np.array(goal, dtype=np.float64)
        self._goal = np.clip(joints, ends.lower - _GIVE, ends.upper + _GIVE)
        self._seconds = max(seconds, _QUICKEST)
        self._start, self._moved = self._goal, 0.0

    @property
    def is_done(self) -> bool:
        """Whether the reference has reached the goal."""
        return self._moved >= self._seconds

    def begin(self, q: Array) -> None:
        """Begin at `q` [rad], shape (7,)."""
        self._start = q.copy()

    def advance(self, q: Array) -> tuple[Array, Array]:
        """Advance by a cycle; return reference (angles, speeds), shapes (7,)."""
        del q
        self._moved = min(self._moved + _DT, self._seconds)
        s, difference = self._moved / self._seconds, self._goal - self._start
        share = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
        rate = 30.0 * s * s * (1.0 - s) ** 2 / self._seconds
        return self._start + share * difference, rate * difference


class StopPath:
    """One joint turned until its stop is felt; the others are held in place."""

    def __init__(self, joint: int, side: Side, ends: StopAngles) -> None:
        """Set the joint, 1-7, and the side of its stop."""
        self._i = joint - 1
        self._sign = 1.0 if side == "high" else -1.0
        self._stop = float((ends.upper if side == "high" else ends.lower)[self._i])
        self._wanted, self._speed, self._is_at_stop = np.zeros(7), 0.0, False

    @property
    def is_done(self) -> bool:
        """Whether the joint has met its stop."""
        return self._is_at_stop

    def begin(self, q: Array) -> None:
        """Begin at `q` [rad], shape (7,)."""
        self._wanted = q.copy()

    def advance(self, q: Array) -> tuple[Array, Array]:
        """Advance by a cycle; return reference (angles, speeds), shapes (7,)."""
        i, rates = self._i, np.zeros(7)
        beyond = self._sign * (q[i] - self._stop)
        self._is_at_stop = self._is_at_stop or bool(
            beyond * STOP_K >= _NOTICED_TORQUE[i]
        )
        if self._is_at_stop:
            return self._wanted, rates
        fastest = _FEEL if beyond > -_NEAR else _TURN
        self._speed = min(self._speed + 2.0 * _DT, fastest)  # gently: 2 rad/s^2
        lead = self._sign * (self._wanted[i] - q[i])
        if lead * _K[i] < _STRONGEST[i]:
            rates[i] = self._sign * self._speed
            self._wanted[i] += _DT * rates[i]
        return self._wanted, rates


class JointGrip:
    """Hands on the links that follow a path."""

    def __init__(self, path: JointPath) -> None:
        self._path = path
        self._has_begun = False

    @property
    def is_done(self) -> bool:
        """Whether the path has ended; the joints are held there."""
        return self._path.is_done

    def step(self, q: Array, support: Array) -> GripTorques:
        """Return the torques of the hands in a cycle.

        Args:
            q: joint positions [rad], shape (7,).
            support: torques against the remaining weight [N m], shape (7,).
        """
        if not self._has_begun:
            self._path.begin(q)
            self._has_begun = True
        wanted, rates = self._path.advance(q)
        return GripTorques(support + _B * rates, _K, _B, wanted.copy(), _STRONGEST)
