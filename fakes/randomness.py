"""Random processes of the simulated world, one generator per trial."""

import math
import zlib
from collections.abc import Callable, Iterator
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


# The processes below step up to 40 times per cycle of 2 ms. As generators they keep
# their frame between steps, which costs a third of a method's call.


class NormalStream:
    """Standard normal numbers one by one, drawn in blocks.

    Attributes:
        next: returns the next number.
    """

    def __init__(self, generator: np.random.Generator, block: int = 4096) -> None:
        self.next: Callable[[], float] = _normals(generator, block).__next__


def _normals(generator: np.random.Generator, block: int) -> Iterator[float]:
    while True:
        yield from generator.standard_normal(block).tolist()


class OrnsteinUhlenbeck:
    """Zero-mean Ornstein-Uhlenbeck process of standard deviation `sd`.

    It begins anywhere in its stationary distribution and steps exactly:
    x <- a x + sd sqrt(1 - a^2) n with a = exp(-dt / time).

    Attributes:
        step: advances by one time step and returns the value.
        value: the value now.
    """

    def __init__(
        self, sd: float, time: float, dt: float, normals: NormalStream
    ) -> None:
        self._sd = sd
        self._time = time
        self._normals = normals
        self.value = sd * normals.next()
        self.set_dt(dt)
        self.step: Callable[[], float] = self._walk().__next__

    def set_dt(self, dt: float) -> None:
        """Let every step from now on be `dt` [s] long."""
        self._keep = math.exp(-dt / self._time)
        self._kick = self._sd * math.sqrt(1.0 - self._keep**2)

    def _walk(self) -> Iterator[float]:
        next_normal = self._normals.next
        while True:
            self.value = value = self._keep * self.value + self._kick * next_normal()
            yield value


class Tremor:
    """Unit-rms noise through a resonator at 9.5 Hz, damping ratio 0.15.

    Attributes:
        step: advances by one time step and returns the value.
    """

    def __init__(self, dt: float, normals: NormalStream) -> None:
        self.step: Callable[[], float] = _resonance(dt, normals).__next__


def _resonance(dt: float, normals: NormalStream) -> Iterator[float]:
    """Yield the resonator's values; semi-implicit Euler."""
    omega, zeta = 2.0 * math.pi * 9.5, 0.15
    square, damping = omega * omega, 2.0 * zeta * omega
    # white input of this intensity gives unit variance: S = 4 zeta omega^3
    intensity = math.sqrt(4.0 * zeta * omega**3 * dt)
    x, v = normals.next(), omega * normals.next()
    while True:
        kick = intensity * normals.next()
        v += dt * (-square * x - damping * v) + kick
        x += dt * v
        yield x
