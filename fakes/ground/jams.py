"""Jams of stones: contacts that stretch, creep, break and collapse under the foot."""

import math
from dataclasses import dataclass

import numpy as np

from fakes.ground.stone_sizes import StoneParameters
from fakes.randomness import NormalStream, UniformStream

_PHI = math.radians(35.0)  # friction angle of the bed
_THETA = (math.radians(30.0), math.radians(52.0))  # range of the flank angle
_STEEPEST = 1.40  # rad
_MU_R, _B_G, _C_T = 0.28, 4.0, 20.0  # rolling stones; N s/m; N s/m
_V_C, _A_C = 0.020, 0.14  # creep [m/s], its sensitivity to load
_LAM0, _LAM1 = 0.4, 2.0  # shuffles per second
_S_LO, _S_HI = 0.7, 2.2  # capacity of a contact, in shares of the jam
_Q0, _TAU = 0.75, 0.4  # strength of a fresh jam, time of ageing [s]
_TOUCH = 0.05  # N; least normal force for a stone to engage
_LITTLE = 1e-9  # N; avoids a division by zero


@dataclass(slots=True)
class Stone:
    """One contact of a jam."""

    weight: float
    k: float
    capacity: float
    engage_at: float
    anchor: float | None = None


class JamSequence:
    """Sequence of locked configurations of stones.

    Attributes:
        releases: number of collapses.
    """

    _J: float  # strength of the present jam [N]
    _T: float  # grip per newton of normal force
    _age: float  # time under load [s]
    _elastic: float  # force of the stretched contacts [N]
    _is_loaded: bool  # a contact was attached in the last step
    _stones: list[Stone]  # contacts
    _weights: float  # sum of their weights

    def __init__(
        self, parameters: StoneParameters, strength: float, rng: np.random.Generator
    ) -> None:
        """Form the first jam directly ahead of the foot.

        Args:
            parameters: parameters of the stones.
            strength: mean capacity of a jam in this trial [N].
            rng: generator of this trial's ground.
        """
        self._p = parameters
        self._strength = strength
        self._generator = rng
        self._normals = NormalStream(rng)
        self._chances = UniformStream(rng)
        # Damping of a pushed and of a rolling contact [N s/m].
        self._c_t, self._b_g = _C_T / parameters.N, _B_G / parameters.N
        self.releases = 0
        self._form(0.0, 0.0)

    def step(self, dt: float, x: float, vx: float, F_n: float, sunk: float) -> float:
        """Advance by `dt` [s] and return the force along -x [N].

        Args:
            dt: time step [s].
            x: position of the sole [m].
            vx: velocity of the sole [m/s].
            F_n: normal force [N].
            sunk: slip sinkage as a share of its final value, for the next jam.
        """
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
        """Detach all contacts: the foot has left the ground."""
        self._elastic = 0.0
        self._is_loaded = False
        for stone in self._stones:
            stone.anchor = None

    def begin_at(self, x: float) -> None:
        """Start with fresh stones at `x` [m]."""
        self._form(x, 0.0)

    def _capacity(self, dt: float, F_n: float) -> float:
        """Return the present capacity of the jam [N]."""
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
            self._collapse(x, sunk)
        elif self._chances.next() < (_LAM0 + _LAM1 * load * load) * dt:
            self._shuffle(x)

    def _collapse(self, x: float, sunk: float) -> None:
        """Collapse at `x` [m] and form the next jam a free run ahead."""
        self._chances.give_back()
        p = self._p
        run_out = p.run * p.d50 * float(self._generator.gamma(p.k_run, 1.0 / p.k_run))
        self.releases += 1
        self._form(x + run_out, sunk)

    def _shuffle(self, x: float) -> None:
        """Relax one attached contact in part."""
        attached = [(s, s.anchor) for s in self._stones if s.anchor is not None]
        if attached:
            self._chances.give_back()
            stone, anchor = attached[int(self._generator.integers(len(attached)))]
            stone.anchor = anchor + float(self._generator.uniform(0.3, 1.0)) * (
                x - anchor
            )

    def _break(self, stone: Stone, x: float) -> None:
        """Detach `stone` at `x` [m]; it engages again after a gap."""
        self._chances.give_back()
        p = self._p
        stone.anchor = None
        stone.engage_at = x + p.gap * p.d50 * float(self._generator.gamma(2.0, 0.5))
        stone.capacity = self._J / p.N * float(self._generator.uniform(_S_LO, _S_HI))

    def _form(self, x: float, sunk: float) -> None:
        """Form a jam that begins at `x` [m]."""
        p, rng = self._p, self._generator
        gamma = float(rng.gamma(p.k_J, 1.0 / p.k_J))
        self._J = self._strength * gamma * (0.8 + 0.4 * sunk)
        self._T = math.tan(min(_PHI + float(rng.uniform(*_THETA)), _STEEPEST))
        self._age = self._elastic = 0.0
        self._is_loaded = False
        self._stones = [self._stone(x) for _ in range(p.N)]
        self._weights = sum(stone.weight for stone in self._stones)

    def _stone(self, x: float) -> Stone:
        p, rng = self._p, self._generator
        return Stone(
            weight=float(rng.gamma(p.k_w, 1.0 / p.k_w)) + 0.05,
            k=p.K_t / p.N * math.exp(p.sigma_k * self._normals.next()),
            capacity=self._J / p.N * float(rng.uniform(_S_LO, _S_HI)),
            engage_at=x + float(rng.random()) * p.disp * p.d50,
        )
