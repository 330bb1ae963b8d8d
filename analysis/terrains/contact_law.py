"""A contact law with state: what a simulator asks of stones, step by step.

A generator answers a recorded motion; a law answers a displacement, and the motion is
what comes of it. Stones jam under a foot, stretch, give way and let go (Albert et al.
2001). With x the place of the foot, v its velocity, f = F_n, a step of dt is

    in the air (f <= 0.05 N): let go, F_t = 0; after 1 s the next touch is the first
    at the first touch: a new jam, x_e = x
    free:     x >= x_e         -> jammed, a = x - min(mu f, 1 N) / k where v > 0, else x
              F_t = mu f c(v) + b v,   c(v) = min(max(v / 0.01, -1), 1)
    jammed:   P  = p (min(max(f, 0.8), 3.5) / 3.5) ^ b1
              a += v_c exp((min(k (x - a) / P, 1) - 1) / 0.14) dt  where x > a
              F  = k (x - a); where F < -mu f: F = -mu f, a = x + mu f / k
              F > P            -> free: a new jam, x_e = x + run
              F > 1.5 N, u0 < lam v dt -> F -= 1.5 N + (F - 1.5 N) u1 ^ (1 / m - 1)
              F_t = F + 20 v where F > 0, else F
    new jam:  log p = b0 + s z0,  log k = k0 + s_k z1,  run = w (-log u1) ^ (1 / h)

with u0, u1 ~ U(0, 1) and z0, z1 ~ N(0, 1) new at every step; b0, b1, s, k0, s_k, w, h,
mu, b, lam, m, v_c are the twelve numbers of the law. `step` is a pure function of the
state and of these draws. More load than 3.5 N is not credited: whoever pushes harder
along presses harder, too, and trials do not tell what a load alone would bear.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, log
from numbers import Integral
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from acquisition.errors import SettingsError
from analysis.breakaway.answers import check_finite
from analysis.terrains.loadings import LEAST_LOAD, Interval90
from analysis.terrains.process_scores import STONES_DROP

FULL_LOAD = 3.5  # N, from which the capacity of a jam is p
DAMPING = 20.0  # N s/m of a jam; not estimated
CREEP_LOAD = 0.14  # share of the capacity over which creep grows by e
SKIN_SPEED = 0.01  # m/s from which skin friction is whole
TOUCH = 0.05  # N
ALOFT = 1.0  # s in the air after which a foot stands anew
FIRST_FORCE = 1.0  # N of skin friction that a jam takes over at most
_BLOCK = 4096  # draws at once
RANGES: Mapping[str, tuple[float, float]] = {  # that a law is read with
    "level": (-5.0, 10.0),
    "load": (0.0, 3.0),
    "spread": (0.0, 3.0),
    "stiffness": (0.0, 20.0),
    "stiffness_spread": (0.0, 3.0),
    "run": (0.0, 10.0),
    "run_shape": (0.1, 100.0),
    "mu": (0.0, 10.0),
    "viscosity": (-1e3, 1e3),
    "partial_rate": (0.0, 1e5),
    "partial_share": (0.01, 0.99),
    "creep": (0.0, 1.0),
}


class ContactNumbers(NamedTuple):
    """The twelve numbers of a law.

    Attributes:
        level: b0, log of the median capacity at F_n >= 3.5 N [log N].
        load: b1, exponent of F_n in the capacity below that.
        spread: s, sd of the log of the capacity.
        stiffness: k0, log of the median stiffness [log N/m].
        stiffness_spread: s_k, sd of its log.
        run: w, scale of the run-out [m].
        run_shape: h, shape of its Weibull distribution.
        mu: skin friction, F_t over F_n of a foot that runs.
        viscosity: b, what F_t gains with v of a foot that runs [N s/m].
        partial_rate: lam, partial drops of 1.5 N or more over way of a jam [1/m].
        partial_share: m, mean share that a partial drop takes of what is above 1.5 N.
        creep: v_c, speed of creep of a jam at its capacity [m/s].
    """

    level: float
    load: float
    spread: float
    stiffness: float
    stiffness_spread: float
    run: float
    run_shape: float
    mu: float
    viscosity: float
    partial_rate: float
    partial_share: float
    creep: float


class JamState(NamedTuple):
    """What a law remembers from one step to the next.

    Attributes:
        is_jammed: stones are stretched, or about to be.
        anchor: a, where they are not [m].
        capacity: p of the jam, or of the next one [N].
        stiffness: k of the same [N/m].
        engage_at: x_e, where the next one begins [m].
        aloft: how long the foot has been in the air [s].
    """

    is_jammed: bool
    anchor: float
    capacity: float
    stiffness: float
    engage_at: float
    aloft: float


BEFORE = JamState(False, 0.0, 1.0, 1.0, 0.0, ALOFT)  # the first touch


class Draw(NamedTuple):
    """Random numbers of one step: two uniform, two normal."""

    u0: float
    u1: float
    z0: float
    z1: float


@dataclass(frozen=True, slots=True)
class ContactLaw:
    """The law of one terrain.

    Attributes:
        numbers: what it is made of.
        intervals: the same with the ends of 90 % intervals, which hold the value of as
            many other trials of the same ground nine times in ten.
        trials: it was fitted to so many.
        releases: and to so many jams that let go.
    """

    numbers: ContactNumbers
    intervals: Mapping[str, Interval90]
    trials: int
    releases: int

    def step(
        self, state: JamState, dt: float, x: float, v: float, F_n: float, draw: Draw
    ) -> tuple[float, JamState]:
        """Return F_t [N] and the next state; its equations stand above.

        Args:
            state: the last one, `BEFORE` at the beginning.
            dt: length of the step [s].
            x: place of the foot along the push [m].
            v: its velocity [m/s].
            F_n: normal force [N].
            draw: of this step alone.
        """
        n = self.numbers
        is_jammed, a, p, k, x_e, aloft = state
        if F_n <= TOUCH:
            return 0.0, JamState(False, a, p, k, x_e, aloft + dt)
        if aloft >= ALOFT:
            p, k, x_e = *self._new(draw), x
        skin = n.mu * F_n
        if not is_jammed:
            if x < x_e:
                return self._free(v, skin), JamState(False, a, p, k, x_e, 0.0)
            a = x - min(skin, FIRST_FORCE) / k if v > 0.0 else x
        P = self.capacity(p, F_n)
        if x > a:
            load = min(k * (x - a) / P, 1.0)
            a += n.creep * exp((load - 1.0) / CREEP_LOAD) * dt
        F = k * (x - a)
        if -skin > F:
            F, a = -skin, x + skin / k
        elif P < F:
            p, k = self._new(draw)
            run = n.run * (-log(draw.u1)) ** (1.0 / n.run_shape)
            return self._free(v, skin), JamState(False, a, p, k, x + run, 0.0)
        elif F > STONES_DROP and draw.u0 < n.partial_rate * v * dt:
            left = F - STONES_DROP
            F = left - left * draw.u1 ** (1.0 / n.partial_share - 1.0)
            a = x - F / k
        force = F + DAMPING * v if F > 0.0 else F
        return force, JamState(True, a, p, k, x_e, 0.0)

    def capacity(self, p: float, F_n: float) -> float:
        """Return P, what a jam of capacity `p` [N] bears under F_n [N]."""
        load = min(max(F_n, LEAST_LOAD), FULL_LOAD)
        return p * (load / FULL_LOAD) ** self.numbers.load

    def _new(self, draw: Draw) -> tuple[float, float]:
        """Return capacity [N] and stiffness [N/m] of a new jam."""
        n = self.numbers
        p = exp(n.level + n.spread * draw.z0)
        return p, exp(n.stiffness + n.stiffness_spread * draw.z1)

    def _free(self, v: float, skin: float) -> float:
        share = min(max(v / SKIN_SPEED, -1.0), 1.0)
        return skin * share + self.numbers.viscosity * v

    def begin(self, seed: int) -> "SteppedContact":
        """Return a contact that is stepped, with draws of its own.

        Args:
            seed: of the draws, 0 or more; the same gives the same forces.

        Raises:
            SettingsError: it is none.
        """
        if isinstance(seed, bool) or not isinstance(seed, Integral) or seed < 0:
            raise SettingsError(
                f"seed = {seed!r} is no whole number of 0 or more.",
                hint="Write e.g. seed=1.",
            )
        return SteppedContact(self, seed)

    def to_dict(self) -> dict[str, Any]:
        """Return the law as plain values, for JSON."""
        return {
            "trials": self.trials,
            "releases": self.releases,
            "numbers": {name: list(one) for name, one in self.intervals.items()},
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "ContactLaw":
        """Return the law of plain values.

        Raises:
            ValueError: a value is missing or not what it should be.
        """
        stored = _StoredLaw.model_validate(content)
        intervals = {
            name: Interval90(*getattr(stored.numbers, name))
            for name in ContactNumbers._fields
        }
        for name, (value, lower, upper) in intervals.items():
            if not lower <= value <= upper:
                raise ValueError(f"{name} does not lie in its interval")
        numbers = ContactNumbers(*(one.value for one in intervals.values()))
        _check(numbers)
        return cls(numbers, intervals, stored.trials, stored.releases)


class SteppedContact:
    """A foot on the ground of a law, from its first touch on.

    Attributes:
        law: of the ground.
        state: of the contact now.
    """

    def __init__(self, law: ContactLaw, seed: int) -> None:
        self.law, self.state = law, BEFORE
        self._rng = np.random.default_rng(seed)
        self._draws: list[tuple[float, float, float, float]] = []

    def step(self, dt: float, x: float, v: float, F_n: float) -> float:
        """Advance by `dt` [s] and return F_t [N], against x.

        Args:
            dt: a millisecond or less follows a jam of these stones under a light arm.
            x: place of the foot along the push [m].
            v: its velocity [m/s].
            F_n: normal force [N], 0 in the air.

        Raises:
            SettingsError: one is not a finite number; the contact is as it was.
        """
        check_finite(dt=dt, x=x, v=v, F_n=F_n)
        if not self._draws:
            u = 1.0 - self._rng.random((_BLOCK, 2))  # never 0
            z = self._rng.standard_normal((_BLOCK, 2))
            self._draws = list(map(tuple, np.hstack([u, z]).tolist()))
        draw = Draw(*self._draws.pop())
        F_t, self.state = self.law.step(self.state, dt, x, v, F_n, draw)
        return F_t

    def capacity(self, F_n: float) -> float:
        """Return the traction at which the jam of now lets go under F_n [N]."""
        return self.law.capacity(self.state.capacity, F_n)


_Value = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e6, le=1e6)]
_Interval = tuple[_Value, _Value, _Value]


def _check(numbers: ContactNumbers) -> None:
    """Refuse numbers that no law can be made of.

    Raises:
        ValueError: one is out of its range.
    """
    for name, (least, most) in RANGES.items():
        value = getattr(numbers, name)
        if not least <= value <= most:
            raise ValueError(
                f"{name} = {value:g} is not between {least:g} and {most:g}"
            )


class _StoredNumbers(BaseModel):
    """Every number of a law with the ends of its interval."""

    model_config = ConfigDict(extra="forbid")

    level: _Interval
    load: _Interval
    spread: _Interval
    stiffness: _Interval
    stiffness_spread: _Interval
    run: _Interval
    run_shape: _Interval
    mu: _Interval
    viscosity: _Interval
    partial_rate: _Interval
    partial_share: _Interval
    creep: _Interval


class _StoredLaw(BaseModel):
    """A law as it is stored."""

    model_config = ConfigDict(extra="forbid")

    trials: Annotated[int, Field(strict=True, ge=2, le=1_000_000)]
    releases: Annotated[int, Field(strict=True, ge=1, le=1_000_000_000)]
    numbers: _StoredNumbers
