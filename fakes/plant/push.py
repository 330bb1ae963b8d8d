"""Model of a person's push across the container.

A spring to a target that moves at a fluctuating speed, with a fluctuating downward
angle and tremor; the target moves back after a slip, and the force limit grows when the
foot is stuck.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fakes.randomness import NormalStream, OrnsteinUhlenbeck, Tremor

_SWERVE, _SWERVE_OVER = 0.075, 0.06  # lateral deviation, over a travel of [m]
_LIFT, _LIFT_OVER = 0.025, 0.04  # height, over a travel of [m]


@dataclass(frozen=True, slots=True)
class Mishaps:
    """Positions of mishaps along the container.

    Attributes:
        swerve_at: start of a lateral deviation [m]; infinite = never.
        lift_at: start of lifting the foot [m]; infinite = never.
    """

    swerve_at: float = math.inf
    lift_at: float = math.inf

    def at(self, x: float) -> tuple[float, float]:
        """Return (lateral offset, height) of the hand's target at `x` [m]."""
        aside = _SWERVE * _bump((x - self.swerve_at) / _SWERVE_OVER)
        return aside, _LIFT * _bump((x - self.lift_at) / _LIFT_OVER)


NO_MISHAPS = Mishaps()


def _bump(share: float) -> float:
    """Return a smooth bump of height 1 over 0 to 1."""
    if not 0.0 < share < 1.0:
        return 0.0
    return math.sin(math.pi * share) ** 2


Vector3 = tuple[float, float, float]

LATERAL_K, LATERAL_B = 400.0, 20.0  # towards the centre line: N/m, N s/m
PUSH_K, PUSH_B = 300.0, 18.0  # along x: N/m, N s/m
_LIFT_K, _LIFT_B = 800.0, 100.0  # while lifting: N/m, N s/m
_Z_K, _Z_B, _Z_TIME = 50.0, 18.0, 0.8  # vertical: N/m, N s/m, s
_WEAKEST = -3.0  # least force along x [N]
_RAMP = 0.4  # time from rest to full speed [s]
_FLATTEST, _STEEPEST = math.radians(-5.0), math.radians(40.0)
_SLIP_SPEED = 0.12  # m/s; a faster slip is noticed
_REACTION, _REACTION_SPREAD, _FASTEST_REACTION = 0.18, 0.03, 0.1  # s
_DEAF = 0.25  # s without another reaction
_PROGRESS, _STUCK = 0.006, 1.5  # m in s; less is stuck
_HARDER, _HARDEST = 3.0, 40.0  # N/s, N
_NO_OFFSET = (0.0, 0.0)  # neither lateral offset nor lift


class HandView(NamedTuple):
    """Observation of the hand, terrain frame: sole and hand point [m], speeds [m/s]."""

    sole: Vector3
    sole_v: Vector3
    hand: Vector3
    hand_v: Vector3


@dataclass(frozen=True, slots=True)
class Pace:
    """Pushing style of an operator.

    Attributes:
        speed: median speed over trials [m/s].
        stiffness: median stiffness of hand and arm over trials [N/m].
        strongest: force at which the hand holds back [N].
        press_deg: mean downward angle of the push over trials [degrees].
        press_spread_deg: its standard deviation over trials [degrees].
        mishaps: mishaps during the push.
    """

    speed: float = 0.040
    stiffness: float = PUSH_K
    strongest: float = 22.0
    press_deg: float = 4.0
    press_spread_deg: float = 6.0
    mishaps: Mishaps = NO_MISHAPS


PACES = {
    "steady": Pace(),
    "slow": Pace(speed=0.030),
    "fast": Pace(speed=0.055),
    "clumsy": Pace(mishaps=Mishaps(swerve_at=0.10, lift_at=0.28)),
}


class Push:
    """One push from rest until the hand's next action."""

    def __init__(
        self, pace: Pace, rng: np.random.Generator, view: HandView, dt: float
    ) -> None:
        """Draw the hand of one trial.

        Args:
            pace: pushing style of the person.
            rng: generator of this trial's hand.
            view: present observation.
            dt: time step [s].
        """
        n = NormalStream(rng)
        self._rng, self._n, self._dt, self._pace = rng, n, dt, pace
        self._K = pace.stiffness * math.exp(0.15 * n.next())
        self._speed = pace.speed * math.exp(0.22 * n.next())
        self._beta = math.radians(pace.press_deg + pace.press_spread_deg * n.next())
        self._wander = OrnsteinUhlenbeck(0.25, 1.2, dt, n)
        self._effort = OrnsteinUhlenbeck(0.06, 0.4, dt, n)
        self._tilt = OrnsteinUhlenbeck(math.radians(9.0), 0.7, dt, n)
        self._press = OrnsteinUhlenbeck(0.8, 0.8, dt, n)
        self._tremor = Tremor(dt, n)
        self._wait = float(rng.uniform(0.6, 1.0))
        self._age = 0.0
        self._x0 = view.hand[0]
        self._xe = 0.0
        self._z_ref = view.hand[2]
        self._strongest = pace.strongest
        self._progress_x, self._progress_age = view.sole[0], 0.0
        self._react_in: float | None = None
        self._react_force = 0.0
        self._deaf = 0.0
        self._z_rest: float | None = None

    def step(self, view: HandView) -> Vector3:
        """Return the force on the hand point along x, y, z [N]."""
        dt = self._dt
        self._age += dt
        x, y, _ = view.hand
        vx, vy, _ = view.hand_v
        self._watch(view.sole[0], view.sole_v[0])
        ramp = (self._age - self._wait) / _RAMP
        ramp = 0.0 if ramp < 0.0 else ramp if ramp < 1.0 else 1.0
        pace = 1.0 + self._wander.step()
        v_e = ramp * self._speed * pace if pace > 0.0 else 0.0
        moved = x - self._x0
        spring = self._K * (self._xe - moved)
        room = (self._strongest - spring) / (0.3 * self._strongest)
        if room > 0.0:
            self._xe += dt * v_e * (room if room < 1.0 else 1.0)
        if self._react_in is None:
            self._react_force = spring
        else:
            self._react(self._react_in - dt, moved)
        force = spring + PUSH_B * (v_e - vx)
        force = force if force > _WEAKEST else _WEAKEST
        unsteady = force * self._effort.step()
        force += unsteady + (0.05 + 0.012 * abs(force)) * self._tremor.step()
        aside, lift = _NO_OFFSET
        if self._pace.mishaps is not NO_MISHAPS:
            aside, lift = self._pace.mishaps.at(view.sole[0])
        lateral = LATERAL_K * (aside - y) - LATERAL_B * vy
        return force, lateral, self._upward(force, view, ramp, lift)

    def _upward(self, push: float, view: HandView, ramp: float, lift: float) -> float:
        dt, z, vz = self._dt, view.hand[2], view.hand_v[2]
        tilt = self._beta + self._tilt.step()
        tilt = _FLATTEST if tilt < _FLATTEST else min(tilt, _STEEPEST)
        wander = self._press.step() * ramp
        self._z_ref += dt * (z - self._z_ref) / _Z_TIME
        if lift > 0.0:
            if self._z_rest is None:
                self._z_rest = z
            self._z_ref = z
            return _LIFT_K * (self._z_rest + lift - z) - _LIFT_B * vz
        self._z_rest = None
        pressed = push * math.tan(tilt) if push > 0.0 else 0.0
        return -(pressed + wander + _Z_B * vz + _Z_K * (z - self._z_ref))

    def _watch(self, x: float, vx: float) -> None:
        """Raise the force limit when stuck; detect a slip of the sole."""
        dt = self._dt
        if x - self._progress_x > _PROGRESS:
            self._progress_x, self._progress_age = x, 0.0
            self._strongest = self._pace.strongest
        else:
            self._progress_age += dt
            if self._progress_age > _STUCK:
                self._strongest = min(self._strongest + _HARDER * dt, _HARDEST)
        self._deaf = self._deaf - dt if self._deaf > dt else 0.0
        if vx > _SLIP_SPEED and self._deaf == 0.0 and self._react_in is None:
            reaction = _REACTION + _REACTION_SPREAD * self._n.next()
            self._react_in = max(_FASTEST_REACTION, reaction)

    def _react(self, remaining: float, x: float) -> None:
        """Count the reaction time down; at its end move the target back."""
        self._react_in = remaining
        if remaining <= 0.0:
            share = float(self._rng.uniform(0.1, 0.5))
            self._xe = x + share * max(self._react_force, 0.0) / self._K
            self._react_in = None
            self._deaf = _DEAF
