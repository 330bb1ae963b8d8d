"""Beds of stones: jams of contacts that load, give way at once and form anew."""

import math
from dataclasses import dataclass

import numpy as np

from fakes.contact import (
    DAMPING_MASS,
    GRID,
    NO_CONTACT,
    Contact,
    LateralBristle,
    Motion,
    height_at,
    smooth_profile,
)
from fakes.randomness import NormalStream


@dataclass(frozen=True, slots=True)
class StoneParameters:
    """A bed of one stone size; lengths of the bed are in units of d50."""

    d50: float
    N: int
    J0: float
    k_J: float
    k_n: float
    run: float
    k_run: float
    disp: float
    gap: float
    s_inf: float
    k_w: float
    sigma_k: float
    K_t: float = 2200.0
    zeta: float = 0.35


STONES = {
    "small": StoneParameters(
        0.019, 7, 12.0, 6.0, 2500.0, 0.60, 2.0, 0.05, 0.10, 0.12, 2.5, 0.35
    ),
    "big": StoneParameters(
        0.037, 4, 12.5, 4.5, 3000.0, 0.50, 1.6, 0.04, 0.08, 0.10, 2.0, 0.45
    ),
}
_PHI = math.radians(35.0)
_THETA = (math.radians(30.0), math.radians(52.0))
_MU_R, _B_G, _C_T = 0.28, 4.0, 20.0
_V_C, _A_C = 0.020, 0.14
_LAM0, _LAM1 = 0.4, 2.0
_S_H, _L_H, _L_S = 0.07, 0.40, 0.06
_S_LO, _S_HI = 0.7, 2.2
_Q0, _TAU = 0.75, 0.4


def slope_factor(incline: float) -> float:
    """Return eta: how much a slope [rad] weakens the bed."""
    return math.cos(incline) * (
        1.0 - 0.5 * math.tan(incline) / math.tan(math.radians(40.0))
    )


@dataclass(slots=True)
class _Stone:
    """One contact of a jam."""

    weight: float
    k: float
    capacity: float
    engage_at: float
    anchor: float | None = None


class StoneBed:
    """A jam of contacts that loads, creeps, gives way at once and forms anew."""

    def __init__(
        self, parameters: StoneParameters, incline: float, rng: np.random.Generator
    ) -> None:
        p = parameters
        self._p = p
        self._rng = rng
        self._normals = NormalStream(rng)
        self._eta = slope_factor(incline)
        self._bed = math.exp(0.12 * self._normals.next())
        self._c_n = 2.0 * p.zeta * math.sqrt(p.k_n * DAMPING_MASS)
        self._profile = _S_H * p.d50 * smooth_profile(rng, _L_H * p.d50)
        self._slope = np.gradient(self._profile, GRID)
        self._sink = 0.0
        self._sink_limit = p.s_inf * p.d50
        self._lateral = LateralBristle(p.K_t)
        self._elastic = 0.0
        self._age = 0.0
        self._stones: list[_Stone] = []
        self._J = 0.0
        self._T = 0.0
        self.releases = 0
        self._new_jam(0.0, run_out=0.0)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self._p.k_n

    def surface(self, x: float) -> float:
        """Return the height of the profile at `x` [m]."""
        return height_at(self._profile, x)

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return {
            "bed_factor": self._bed,
            "J0": self._p.J0,
            "d50": self._p.d50,
            "releases": float(self.releases),
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the jam by `dt` and return the force."""
        p = self._p
        x, vx = motion.x, motion.vx
        slope = min(max(height_at(self._slope, x), -0.5), 0.5)
        depth = height_at(self._profile, x) - self._sink - motion.z
        if depth <= 0.0:
            self._lose_contact(x)
            return NO_CONTACT
        F_n = max(0.0, p.k_n * depth + self._c_n * (slope * vx - motion.vz))
        rate = max(vx, 0.0) * (self._sink_limit - self._sink) / _L_S
        self._sink += dt * rate * min(1.0, F_n / 5.0)
        F_t = self._tangential(dt, x, vx, F_n) + F_n * slope
        return Contact(F_t, self._lateral.step(motion.y, 0.6 * F_n), F_n)

    def _tangential(self, dt: float, x: float, vx: float, F_n: float) -> float:
        p = self._p
        sign = math.tanh(vx / 0.01)
        capacity, load = self._capacity(dt, F_n)
        creep = _V_C * math.exp((load - 1.0) / _A_C) * dt if 0.3 < load < 1.5 else 0.0
        skin = _MU_R * F_n / sum(stone.weight for stone in self._stones)
        total = elastic = 0.0
        detached = 0
        for stone in self._stones:
            rest = skin * stone.weight
            if stone.anchor is None:
                total += rest * sign
                detached += 1
                if x > stone.engage_at and F_n > 0.05:
                    stone.anchor = x
                continue
            stone.anchor += creep
            force = stone.k * (x - stone.anchor)
            if force > stone.capacity:
                self._break(stone, x)
                total += rest * sign
                continue
            if force < -rest:
                stone.anchor = x + rest / stone.k
                force = -rest
            elastic += force
            total += force + (_C_T / p.N * vx if force > 0.0 else 0.0)
        total += _B_G * vx * detached / p.N
        self._elastic = elastic
        self._release_or_shuffle(dt, x, capacity, detached)
        return total

    def _capacity(self, dt: float, F_n: float) -> tuple[float, float]:
        """Return (force the jam can bear now [N], load as a share of it)."""
        attached = any(stone.anchor is not None for stone in self._stones)
        self._age = self._age + dt if attached else 0.0
        aged = _Q0 + (1.0 - _Q0) * (1.0 - math.exp(-self._age / _TAU))
        capacity = max(min(self._J * aged, F_n * self._T), 1e-9)
        return capacity, self._elastic / capacity

    def _release_or_shuffle(
        self, dt: float, x: float, capacity: float, detached: int
    ) -> None:
        if detached == len(self._stones):
            return
        load = self._elastic / capacity
        if load > 1.0:
            p = self._p
            run_out = p.run * p.d50 * float(self._rng.gamma(p.k_run, 1.0 / p.k_run))
            self.releases += 1
            self._new_jam(x, run_out)
        elif float(self._rng.random()) < (_LAM0 + _LAM1 * load * load) * dt:
            attached = [s for s in self._stones if s.anchor is not None]
            stone = attached[int(self._rng.integers(len(attached)))]
            assert stone.anchor is not None
            loss = float(self._rng.uniform(0.3, 1.0))
            stone.anchor += loss * (x - stone.anchor)

    def _break(self, stone: _Stone, x: float) -> None:
        p = self._p
        stone.anchor = None
        stone.engage_at = x + p.gap * p.d50 * float(self._rng.gamma(2.0, 0.5))
        stone.capacity = self._J / p.N * float(self._rng.uniform(_S_LO, _S_HI))

    def _new_jam(self, x: float, run_out: float) -> None:
        p, rng = self._p, self._rng
        settled = 0.8 + 0.4 * self._sink / self._sink_limit
        gamma = float(rng.gamma(p.k_J, 1.0 / p.k_J))
        self._J = p.J0 * gamma * self._eta * self._bed * settled
        self._T = math.tan(min(_PHI + float(rng.uniform(*_THETA)), 1.40))
        self._age = 0.0
        self._elastic = 0.0
        self._stones = [
            _Stone(
                weight=float(rng.gamma(p.k_w, 1.0 / p.k_w)) + 0.05,
                k=p.K_t / p.N * math.exp(p.sigma_k * self._normals.next()),
                capacity=self._J / p.N * float(rng.uniform(_S_LO, _S_HI)),
                engage_at=x + run_out + float(rng.random()) * p.disp * p.d50,
            )
            for _ in range(p.N)
        ]

    def _lose_contact(self, x: float) -> None:
        self._lateral.release()
        self._elastic = 0.0
        for stone in self._stones:
            if stone.anchor is not None:
                stone.anchor = None
                stone.engage_at = x
