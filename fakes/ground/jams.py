"""Jams of stones: contacts that stretch, creep, break and collapse under a foot."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fakes.ground.stone_sizes import StoneParameters
from fakes.randomness import DrawnAhead, NormalStream

_PHI = math.radians(35.0)  # friction angle of the bed
_THETA = (math.radians(30.0), math.radians(52.0))  # of the flank that is ridden up
_STEEPEST = 1.40  # rad
MU_R, B_G, C_T = 0.28, 4.0, 20.0  # rolling stones; N s/m; N s/m
V_C, A_C = 0.020, 0.14  # creep [m/s], its sensitivity to load
LAM0, LAM1 = 0.4, 2.0  # shuffles per second
_S_LO, _S_HI = 0.7, 2.2  # capacity of a contact, in shares of the jam
Q0, TAU = 0.75, 0.4  # strength of a fresh jam, time of ageing [s]
TOUCH = 0.05  # N, below which no stone engages
LITTLE = 1e-9  # N, keeps the load finite


@dataclass(slots=True)
class Stone:
    """One contact of a jam."""

    weight: float
    k: float
    capacity: float
    engage_at: float
    anchor: float | None = None


class Chances(Protocol):
    """Numbers from 0 to below 1 of which those not taken can be given back."""

    def next(self) -> float:
        """Return the next number."""
        ...

    def give_back(self) -> None:
        """Let the generator stand right behind the last number that was taken."""
        ...


class JamSequence:
    """One locked configuration of stones after another.

    Attributes:
        releases: how many have collapsed.
        stones: contacts of the jam of now.
        weights: sum of their weights.
        J, T: its strength [N] and its grip per newton of load.
        age: how long it has been loaded [s].
        elastic: force of its stretched contacts [N].
        is_loaded: a contact was attached in the last step.
        c_t, b_g: damping of a pushed and of a rolling contact [N s/m].
        chances: decide about shuffles.
    """

    J: float
    T: float
    age: float
    elastic: float
    is_loaded: bool
    stones: list[Stone]
    weights: float

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
        self.generator = rng
        self._normals = NormalStream(rng)
        self.chances: Chances = DrawnAhead(rng)
        self.c_t = C_T / parameters.N
        self.b_g = B_G / parameters.N
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
        load = self.elastic / capacity
        creep = V_C * math.exp((load - 1.0) / A_C) * dt if 0.3 < load < 1.5 else 0.0
        skin = MU_R * F_n / self.weights  # per share of the load
        elastic = rolling = 0.0
        pushed = detached = 0
        for stone in self.stones:
            anchor = stone.anchor
            if anchor is None:
                rolling += stone.weight
                detached += 1
                if x > stone.engage_at and F_n > TOUCH:
                    stone.anchor = x
                continue
            anchor += creep
            force = stone.k * (x - anchor)
            if force > stone.capacity:
                self.break_stone(stone, x)
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
        self.elastic = elastic
        self.is_loaded = detached < len(self.stones)
        if self.is_loaded:
            self._collapse_or_shuffle(dt, x, elastic / capacity, sunk)
        total = elastic + (self.c_t * pushed + self.b_g * detached) * vx
        if rolling:
            total += skin * rolling * math.tanh(vx / 0.01)
        return total

    def lose_contact(self) -> None:
        """Let go of the foot, which has left the ground."""
        self.elastic = 0.0
        self.is_loaded = False
        for stone in self.stones:
            stone.anchor = None

    def begin_at(self, x: float) -> None:
        """Meet stones that have not borne the foot, at `x` [m]."""
        self._form(x, 0.0)

    def capacity_at(self, F_n: float) -> float:
        """Return the force that the jam can bear under `F_n` [N]; nothing ages."""
        return self._capacity(0.0, F_n)

    def _capacity(self, dt: float, F_n: float) -> float:
        """Return the force that the jam can bear now [N]."""
        if self.is_loaded:
            self.age += dt
        aged = Q0 + (1.0 - Q0) * (1.0 - math.exp(-self.age / TAU))
        strength, grip = self.J * aged, F_n * self.T
        capacity = strength if strength < grip else grip
        return capacity if capacity > LITTLE else LITTLE

    def _collapse_or_shuffle(
        self, dt: float, x: float, load: float, sunk: float
    ) -> None:
        if load > 1.0:
            self.collapse(x, sunk)
        elif self.chances.next() < (LAM0 + LAM1 * load * load) * dt:
            self.shuffle(x)

    def collapse(self, x: float, sunk: float) -> None:
        """Let go at `x` [m] and form the next jam a free run ahead."""
        self.chances.give_back()
        p = self._p
        run_out = p.run * p.d50 * float(self.generator.gamma(p.k_run, 1.0 / p.k_run))
        self.releases += 1
        self._form(x + run_out, sunk)

    def shuffle(self, x: float) -> None:
        """Let one attached contact lose some of its stretch."""
        attached = [(s, s.anchor) for s in self.stones if s.anchor is not None]
        if attached:
            self.chances.give_back()
            stone, anchor = attached[int(self.generator.integers(len(attached)))]
            stone.anchor = anchor + float(self.generator.uniform(0.3, 1.0)) * (
                x - anchor
            )

    def break_stone(self, stone: Stone, x: float) -> None:
        """Let `stone` go at `x` [m]; it meets its next seat after a gap."""
        self.chances.give_back()
        p = self._p
        stone.anchor = None
        stone.engage_at = x + p.gap * p.d50 * float(self.generator.gamma(2.0, 0.5))
        stone.capacity = self.J / p.N * float(self.generator.uniform(_S_LO, _S_HI))

    def _form(self, x: float, sunk: float) -> None:
        """Form a jam that begins at `x` [m]."""
        p, rng = self._p, self.generator
        gamma = float(rng.gamma(p.k_J, 1.0 / p.k_J))
        self.J = self._strength * gamma * (0.8 + 0.4 * sunk)
        self.T = math.tan(min(_PHI + float(rng.uniform(*_THETA)), _STEEPEST))
        self.age = self.elastic = 0.0
        self.is_loaded = False
        self.stones = [self._stone(x) for _ in range(p.N)]
        self.weights = sum(stone.weight for stone in self.stones)

    def _stone(self, x: float) -> Stone:
        p, rng = self._p, self.generator
        return Stone(
            weight=float(rng.gamma(p.k_w, 1.0 / p.k_w)) + 0.05,
            k=p.K_t / p.N * math.exp(p.sigma_k * self._normals.next()),
            capacity=self.J / p.N * float(rng.uniform(_S_LO, _S_HI)),
            engage_at=x + float(rng.random()) * p.disp * p.d50,
        )
