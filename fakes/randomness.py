"""Random processes of the simulated world, one generator per trial."""

import math
import zlib
from typing import NamedTuple

import numpy as np


class TrialGenerators(NamedTuple):
    """The generator of one trial, divided so that none waits for another's draws.

    How often the sensor is read then changes nothing for ground and hand.
    """

    ground: np.random.Generator
    hand: np.random.Generator
    sensor: np.random.Generator


def trial_generator(seed: int, terrain: str, trial: int) -> np.random.Generator:
    """Return the generator of one trial: same arguments, same numbers."""
    return np.random.default_rng([seed, zlib.crc32(terrain.encode()), trial])


def trial_generators(seed: int, terrain: str, trial: int) -> TrialGenerators:
    """Return the generator of one trial, divided among ground, hand and sensor."""
    return TrialGenerators(*trial_generator(seed, terrain, trial).spawn(3))


class NormalStream:
    """Standard normal numbers one by one, drawn in blocks."""

    def __init__(self, generator: np.random.Generator, block: int = 4096) -> None:
        self._generator = generator
        self._block = block
        self._values: list[float] = []

    def next(self) -> float:
        """Return the next number."""
        if not self._values:
            self._values = self._generator.standard_normal(self._block).tolist()
            self._values.reverse()
        return self._values.pop()


class OrnsteinUhlenbeck:
    """Zero-mean Ornstein-Uhlenbeck process of standard deviation `sd`.

    It begins anywhere in its stationary distribution and steps exactly:
    x <- a x + sd sqrt(1 - a^2) n with a = exp(-dt / time).
    """

    def __init__(
        self, sd: float, time: float, dt: float, normals: NormalStream
    ) -> None:
        self._sd = sd
        self._time = time
        self._normals = normals
        self.value = sd * normals.next()
        self.set_dt(dt)

    def set_dt(self, dt: float) -> None:
        """Let every step from now on be `dt` [s] long."""
        self._keep = math.exp(-dt / self._time)
        self._kick = self._sd * math.sqrt(1.0 - self._keep**2)

    def step(self) -> float:
        """Advance by one time step and return the value."""
        self.value = self._keep * self.value + self._kick * self._normals.next()
        return self.value


class Tremor:
    """Unit-rms noise through a resonator at 9.5 Hz, damping ratio 0.15."""

    def __init__(self, dt: float, normals: NormalStream) -> None:
        omega, zeta = 2.0 * math.pi * 9.5, 0.15
        self._normals = normals
        self._dt = dt
        self._omega2 = omega * omega
        self._damp = 2.0 * zeta * omega
        # white input of this intensity gives unit variance: S = 4 zeta omega^3
        self._kick = math.sqrt(4.0 * zeta * omega**3 * dt)
        self._x = normals.next()
        self._v = omega * normals.next()

    def step(self) -> float:
        """Advance by one time step and return the value (semi-implicit Euler)."""
        kick = self._kick * self._normals.next()
        self._v += self._dt * (-self._omega2 * self._x - self._damp * self._v) + kick
        self._x += self._dt * self._v
        return self._x
