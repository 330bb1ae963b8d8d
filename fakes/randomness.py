"""Random generators and processes of the simulated world."""

import math
import zlib
from collections.abc import Iterator
from functools import lru_cache
from operator import length_hint
from typing import NamedTuple

import numpy as np


class TrialGenerators(NamedTuple):
    """Independent generators of one trial.

    Separate, so that the number of sensor reads does not affect ground and hand.
    """

    ground: np.random.Generator
    hand: np.random.Generator
    sensor: np.random.Generator


def trial_generator(seed: int, terrain: str, trial: int) -> np.random.Generator:
    """Return the generator of one trial: same arguments, same numbers."""
    return np.random.default_rng([seed, zlib.crc32(terrain.encode()), trial])


def trial_generators(seed: int, terrain: str, trial: int) -> TrialGenerators:
    """Return the generators of one trial for ground, hand and sensor."""
    return TrialGenerators(*trial_generator(seed, terrain, trial).spawn(3))


def friction_generator(seed: int) -> np.random.Generator:
    """Return the generator of the arm's friction, independent of the trial."""
    return trial_generator(seed, "friction", 0)


def winding_generator(seed: int) -> np.random.Generator:
    """Return the generator of the motor windings, independent of the trial."""
    return trial_generator(seed, "windings", 0)


def sound_rig_generator(seed: int) -> np.random.Generator:
    """Return the generator of the tolerances between sound rigs."""
    return trial_generator(seed, "sound rig", 0)


class NormalStream:
    """Stream of standard normal numbers, drawn in blocks."""

    def __init__(self, generator: np.random.Generator, block: int = 4096) -> None:
        self._generator = generator
        self._block = block
        self._rest: Iterator[float] = iter(())

    def next(self) -> float:
        """Return the next number."""
        for number in self._rest:
            return number
        self._rest = iter(self._generator.standard_normal(self._block).tolist())
        return next(self._rest)


class UniformStream:
    """Uniform numbers in [0, 1), drawn in blocks whose remainder can be given back.

    After `give_back` the generator is in the state as if the numbers had been drawn one
    by one.
    """

    def __init__(self, generator: np.random.Generator, block: int = 64) -> None:
        self._generator = generator
        self._block = block
        self._state = generator.bit_generator.state
        self._rest: Iterator[float] = iter(())

    def next(self) -> float:
        """Return the next number."""
        for number in self._rest:
            return number
        self._state = self._generator.bit_generator.state
        self._rest = iter(self._generator.random(self._block).tolist())
        return next(self._rest)

    def give_back(self) -> None:
        """Reset the generator to the state after the last number taken."""
        remaining = length_hint(self._rest)
        if remaining:
            self._generator.bit_generator.state = self._state
            self._generator.random(self._block - remaining)
            self._rest = iter(())


@lru_cache(maxsize=64)  # a sensor calls it every 10 ms with the same seven arguments
def exact_step(sd: float, time: float, dt: float) -> tuple[float, float]:
    """Return (a, b) of the step x <- a x + b n of an Ornstein-Uhlenbeck process.

    a = exp(-dt / time), b = sd sqrt(1 - a^2): exact for any step length.

    Args:
        sd: standard deviation of the process.
        time: correlation time [s].
        dt: step length [s].
    """
    keep = math.exp(-dt / time)
    return keep, sd * math.sqrt(1.0 - keep * keep)


class OrnsteinUhlenbeck:
    """Zero-mean Ornstein-Uhlenbeck process of standard deviation `sd`.

    Starts from its stationary distribution; see `exact_step`.
    """

    def __init__(
        self, sd: float, time: float, dt: float, normals: NormalStream
    ) -> None:
        self._value = sd * normals.next()
        self._keep, self._kick = exact_step(sd, time, dt)
        self._normals = normals

    def step(self) -> float:
        """Advance by one time step and return the value."""
        self._value = self._keep * self._value + self._kick * self._normals.next()
        return self._value


class Tremor:
    """Unit-rms noise through a resonator at 9.5 Hz, damping ratio 0.15.

    x'' + 2 zeta omega x' + omega^2 x = noise, by semi-implicit Euler. The first step
    draws the initial state.
    """

    def __init__(self, dt: float, normals: NormalStream) -> None:
        omega, zeta = 2.0 * math.pi * 9.5, 0.15
        self._dt, self._omega, self._normals = dt, omega, normals
        self._spring, self._keep = -dt * omega * omega, 1.0 - dt * 2.0 * zeta * omega
        # White input of this intensity gives unit variance: S = 4 zeta omega^3
        self._intensity = math.sqrt(4.0 * zeta * omega**3 * dt)
        self._x, self._v = 0.0, 0.0
        self._has_begun = False

    def step(self) -> float:
        """Advance by one time step and return the value."""
        if not self._has_begun:
            self._has_begun = True
            self._x = self._normals.next()
            self._v = self._omega * self._normals.next()
        noise = self._intensity * self._normals.next()
        self._v = self._keep * self._v + self._spring * self._x + noise
        self._x += self._dt * self._v
        return self._x
