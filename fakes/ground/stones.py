"""Beds of stones: an uneven surface that sinks under the foot, and its jams."""

import math
from dataclasses import dataclass

import numpy as np

from fakes.ground.contact import DAMPING_MASS, NO_CONTACT, Contact, Motion
from fakes.ground.footing import Footing
from fakes.ground.profile import GRID, locate, smooth_profile, value_at
from fakes.ground.stone_sizes import StoneParameters, slope_factor
from fakes.randomness import DrawnAhead, NormalStream

_PHI = math.radians(35.0)  # friction angle of the bed
_THETA = (math.radians(30.0), math.radians(52.0))  # of the flank that is ridden up
_STEEPEST = 1.40  # rad
_MU_R, _B_G, _C_T = 0.28, 4.0, 20.0  # rolling stones; N s/m; N s/m
_V_C, _A_C = 0.020, 0.14  # creep [m/s], its sensitivity to load
_LAM0, _LAM1 = 0.4, 2.0  # shuffles per second
_S_LO, _S_HI = 0.7, 2.2  # capacity of a contact, in shares of the jam
_Q0, _TAU = 0.75, 0.4  # strength of a fresh jam, time of ageing [s]
_TOUCH = 0.05  # N, below which no stone engages
_LITTLE = 1e-9  # N, keeps the load finite


@dataclass(slots=True)
class _Stone:
    """One contact of a jam."""

    weight: float
    k: float
    capacity: float
    engage_at: float
    anchor: float | None = None


class JamSequence:
    """One locked configuration of stones after another.

    Attributes:
        releases: how many have collapsed.
    """

    def __init__(
        self, parameters: StoneParameters, strength: float, rng: np.random.Generator
    ) -> None:
        """Form the first jam, right before the foot.

        Args:
            parameters: of the stones.
            strength: mean capacity of a jam here and in this trial [N].
            rng: of this trial's ground.
        """
        self._p = parameters
        self._strength = strength
        self._rng = rng
        self._normals = NormalStream(rng)
        self._chances = DrawnAhead(rng)
        self._c_t = _C_T / parameters.N
        self._b_g = _B_G / parameters.N
        self.releases = 0
        self._form(0.0, 0.0)

    def step(
        self, dt: float, motion: tuple[float, float], F_n: float, sunk: float
    ) -> float:
        """Advance by `dt` [s] and return the force against x [N].

        Args:
            dt: time step [s].
            motion: x [m] and vx [m/s] of the sole.
            F_n: normal force [N].
            sunk: share of the final slip sinkage, for the next jam.
        """
        x, vx = motion
        capacity = self._capacity(dt, F_n)
        load = self._elastic / capacity
        creep = _V_C * math.exp((load - 1.0) / _A_C) * dt if 0.3 < load < 1.5 else 0.0
        skin = _MU_R * F_n / self._weights  # per share of the load
        elastic = rolling = 0.0
        pushed = detached = 0
        for stone in self._stones:
            anchor = stone.anchor
            if anchor is None:
                rolling += stone.weight
                detached += 1
                if x > stone.engage_at and F_n > _TOUCH:
                    stone.anchor = x
                continue
            anchor += creep
            force = stone.k * (x - anchor)
            if force > stone.capacity:
                self._break(stone, x)
                rolling += stone.weight
                continue
            if force > 0.0:
                pushed += 1
            elif force < -skin * stone.weight:
                # the flank separates: only skin friction resists backward motion
                force = -skin * stone.weight
                anchor = x - force / stone.k
            stone.anchor = anchor
            elastic += force
        self._elastic = elastic
        self._is_loaded = detached < len(self._stones)
        if self._is_loaded:
            self._collapse_or_shuffle(dt, x, elastic / capacity, sunk)
        total = elastic + (self._c_t * pushed + self._b_g * detached) * vx
        if rolling:
            total += skin * rolling * math.tanh(vx / 0.01)
        return total

    def lose_contact(self) -> None:
        """Let go of the foot, which has left the ground."""
        self._elastic = 0.0
        self._is_loaded = False
        for stone in self._stones:
            stone.anchor = None

    def begin_at(self, x: float) -> None:
        """Meet stones that have not borne the foot, at `x` [m]."""
        self._form(x, 0.0)

    def capacity_at(self, F_n: float) -> float:
        """Return the force that the jam can bear under `F_n` [N]; nothing ages."""
        return self._capacity(0.0, F_n)

    def _capacity(self, dt: float, F_n: float) -> float:
        """Return the force that the jam can bear now [N]."""
        if self._is_loaded:
            self._age += dt
        aged = _Q0 + (1.0 - _Q0) * (1.0 - math.exp(-self._age / _TAU))
        strength, grip = self._J * aged, F_n * self._T
        capacity = strength if strength < grip else grip
        return capacity if capacity > _LITTLE else _LITTLE

    def _collapse_or_shuffle(
        self, dt: float, x: float, load: float, sunk: float
    ) -> None:
        if load > 1.0:
            self._chances.give_back()
            p = self._p
            run_out = p.run * p.d50 * float(self._rng.gamma(p.k_run, 1.0 / p.k_run))
            self.releases += 1
            self._form(x + run_out, sunk)
        elif self._chances.next() < (_LAM0 + _LAM1 * load * load) * dt:
            self._shuffle(x)

    def _shuffle(self, x: float) -> None:
        """Let one attached contact lose some of its stretch."""
        attached = [(s, s.anchor) for s in self._stones if s.anchor is not None]
        if attached:
            self._chances.give_back()
            stone, anchor = attached[int(self._rng.integers(len(attached)))]
            stone.anchor = anchor + float(self._rng.uniform(0.3, 1.0)) * (x - anchor)

    def _break(self, stone: _Stone, x: float) -> None:
        self._chances.give_back()
        p = self._p
        stone.anchor = None
        stone.engage_at = x + p.gap * p.d50 * float(self._rng.gamma(2.0, 0.5))
        stone.capacity = self._J / p.N * float(self._rng.uniform(_S_LO, _S_HI))

    def _form(self, x: float, sunk: float) -> None:
        """Form a jam that begins at `x` [m]."""
        p, rng = self._p, self._rng
        gamma = float(rng.gamma(p.k_J, 1.0 / p.k_J))
        self._J = self._strength * gamma * (0.8 + 0.4 * sunk)
        self._T = math.tan(min(_PHI + float(rng.uniform(*_THETA)), _STEEPEST))
        self._age = self._elastic = 0.0
        self._is_loaded = False
        self._stones = [self._stone(x) for _ in range(p.N)]
        self._weights = sum(stone.weight for stone in self._stones)

    def _stone(self, x: float) -> _Stone:
        p, rng = self._p, self._rng
        return _Stone(
            weight=float(rng.gamma(p.k_w, 1.0 / p.k_w)) + 0.05,
            k=p.K_t / p.N * math.exp(p.sigma_k * self._normals.next()),
            capacity=self._J / p.N * float(rng.uniform(_S_LO, _S_HI)),
            engage_at=x + float(rng.random()) * p.disp * p.d50,
        )


_S_H, _L_H = 0.07, 0.40  # height of the surface and its correlation length [d50]
_L_S = 0.06  # slip over which the bed sinks [m]
_FIRM = 5.0  # normal force from which it sinks fully [N]
_STEEPEST_SLOPE = 0.5  # slope that a foot can feel
_MU_LATERAL = 0.6
# A foot that was in the air for this long and comes down this far away stands anew; a
# bounce or a hop of the pushed foot (up to 0.7 s and 1.4 d50 in a trial) does not.
_LIFTED, _AWAY = 1.0, 3.0  # s, d50


class StoneBed:
    """A bed of stones as one foot meets it in one trial.

    A foot that is lifted and set down elsewhere stands on stones that nothing has
    pushed or pressed yet: a jam of its own, and no slip sinkage.
    """

    def __init__(
        self, parameters: StoneParameters, incline: float, rng: np.random.Generator
    ) -> None:
        """Lay the bed.

        Args:
            parameters: of the stones.
            incline: of the container [rad].
            rng: of this trial's ground; everything random is drawn from it.
        """
        p = parameters
        self._p = p
        self._bed = math.exp(0.12 * float(rng.standard_normal()))
        self._k_n = p.k_n
        self._c_n = 2.0 * p.zeta * math.sqrt(p.k_n * DAMPING_MASS)
        profile = _S_H * p.d50 * smooth_profile(rng, _L_H * p.d50)
        self._slope = np.gradient(profile, GRID).tolist()
        self._profile = profile.tolist()
        self._sink = 0.0
        self._sink_limit = p.s_inf * p.d50
        self._aloft = 0.0  # since the foot was lifted [s]
        self._stood_at: float | None = None
        self._footing = Footing(p.K_t, p.cop, 0.5 * p.d50, rng)
        self._jams = JamSequence(p, p.J0 * slope_factor(incline) * self._bed, rng)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self._p.k_n

    @property
    def releases(self) -> int:
        """How many jams have let go."""
        return self._jams.releases

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed bed at `x` [m]."""
        return value_at(self._profile, x)

    def capacity(self, x: float, F_n: float) -> float:
        """Return the traction that the foot at `x` [m] can be given now [N]."""
        del x
        return self._jams.capacity_at(F_n)

    def _land(self, x: float) -> None:
        """Touch the ground again; far from where the foot stood it is fresh."""
        is_lifted, self._aloft = self._aloft >= _LIFTED, 0.0
        before = self._stood_at
        if is_lifted and before is not None and abs(x - before) >= _AWAY * self._p.d50:
            self._sink = 0.0
            self._jams.begin_at(x)

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return {
            "bed_factor": self._bed,
            "J0": self._p.J0,
            "d50": self._p.d50,
            "releases": float(self.releases),
        }

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the bed by `dt` [s] and return what it does to the foot."""
        x, _, z, vx, _, vz, _, _, _ = motion
        sink = self._sink
        row, share = locate(x)
        h, s = self._profile, self._slope
        depth = h[row] + share * (h[row + 1] - h[row]) - sink - z
        if depth <= 0.0:
            self._aloft += dt
            self._footing.release()
            self._jams.lose_contact()
            return NO_CONTACT
        if self._aloft > 0.0:
            self._land(x)
        self._stood_at = x
        slope = s[row] + share * (s[row + 1] - s[row])
        F_n = self._k_n * depth + self._c_n * (slope * vx - vz)
        F_n = F_n if F_n > 0.0 else 0.0
        sunk = sink / self._sink_limit
        if vx > 0.0:
            rate = vx * (self._sink_limit - sink) / _L_S
            self._sink = sink + dt * rate * (F_n / _FIRM if F_n < _FIRM else 1.0)
        F_t = self._jams.step(dt, (x, vx), F_n, sunk)
        if not -_STEEPEST_SLOPE <= slope <= _STEEPEST_SLOPE:
            slope = math.copysign(_STEEPEST_SLOPE, slope)
        F_t += F_n * slope
        return self._footing.step(dt, motion, F_t, F_n, _MU_LATERAL)
