"""Random processes of the simulated world, one generator per trial."""

import math
import zlib
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import chain
from operator import length_hint
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


def friction_generator(seed: int) -> np.random.Generator:
    """Return the generator of the arm's friction: the same in every trial of a seed."""
    return trial_generator(seed, "friction", 0)


# Streams and processes below step up to 50 times per cycle of 2 ms. A chain hands the
# numbers of a block out at half the cost of a generator, and a generator keeps its
# frame between steps, which costs a third of a method's call.


class NormalStream:
    """Standard normal numbers one by one, drawn in blocks.

    Attributes:
        next: returns the next number.
    """

    def __init__(self, generator: np.random.Generator, block: int = 4096) -> None:
        blocks = _blocks(generator, block)
        self.next: Callable[[], float] = chain.from_iterable(blocks).__next__


def _blocks(generator: np.random.Generator, block: int) -> Iterator[list[float]]:
    while True:
        yield generator.standard_normal(block).tolist()


def _nothing() -> Iterator[float]:
    empty: list[float] = []
    return iter(empty)


class DrawnAhead:
    """Numbers from 0 to below 1, drawn in blocks of which the rest can be given back.

    Whoever draws from the generator after `give_back` draws what he would have drawn
    if the numbers had been taken one by one.
    """

    def __init__(self, generator: np.random.Generator, block: int = 64) -> None:
        self._generator = generator
        self._block = block
        self._state = generator.bit_generator.state
        self._rest = _nothing()

    def next(self) -> float:
        """Return the next number."""
        for number in self._rest:
            return number
        self._state = self._generator.bit_generator.state
        self._rest = iter(self._generator.random(self._block).tolist())
        return next(self._rest)

    def give_back(self) -> None:
        """Let the generator stand right behind the last number that was taken."""
        left = length_hint(self._rest)
        if left:
            self._generator.bit_generator.state = self._state
            self._generator.random(self._block - left)
            self._rest = _nothing()


@lru_cache(maxsize=64)  # every 10 ms a sensor asks for the same seven again
def exact_step(sd: float, time: float, dt: float) -> tuple[float, float]:
    """Return (a, b) of a step x <- a x + b n of an Ornstein-Uhlenbeck process.

    a = exp(-dt / time), b = sd sqrt(1 - a^2): exact for any length of step.

    Args:
        sd: standard deviation of the process.
        time: over which it forgets [s].
        dt: length of the step [s].
    """
    keep = math.exp(-dt / time)
    return keep, sd * math.sqrt(1.0 - keep * keep)


class OrnsteinUhlenbeck:
    """Zero-mean Ornstein-Uhlenbeck process of standard deviation `sd`.

    It begins anywhere in its stationary distribution; see `exact_step`.

    Attributes:
        step: advances by one time step and returns the value.
    """

    def __init__(
        self, sd: float, time: float, dt: float, normals: NormalStream
    ) -> None:
        start = sd * normals.next()
        walk = _walk(start, *exact_step(sd, time, dt), normals)
        self.step: Callable[[], float] = walk.__next__


def _walk(
    value: float, keep: float, kick: float, normals: NormalStream
) -> Iterator[float]:
    next_normal = normals.next
    while True:
        value = keep * value + kick * next_normal()
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
    spring, keep = -dt * omega * omega, 1.0 - dt * 2.0 * zeta * omega
    # white input of this intensity gives unit variance: S = 4 zeta omega^3
    intensity = math.sqrt(4.0 * zeta * omega**3 * dt)
    next_normal = normals.next
    x, v = next_normal(), omega * next_normal()
    while True:
        v = keep * v + spring * x + intensity * next_normal()
        x += dt * v
        yield x
