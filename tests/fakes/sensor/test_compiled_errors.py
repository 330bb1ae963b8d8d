"""The compiled errors of a sensor are those of Python to the last bit."""

import struct

import numpy as np
import pytest

from fakes.kernels import COMPILED, chosen_dynamics
from fakes.sensor.errors import ErrorScale, SensorErrors

if chosen_dynamics() != COMPILED:
    pytest.skip("nothing is compiled here", allow_module_level=True)
from fakes.sensor.compiled import CompiledErrors

PERIOD_NS = 1_250_000
COARSE = ErrorScale(walk=0.1, drift=0.2, white=0.3, resolution=0.5)
STEPLESS = ErrorScale(walk=0.0, drift=0.0, white=0.01, resolution=0.0)


def both(seed, *scales):
    return [
        kind(np.random.default_rng(seed), *scales)
        for kind in (SensorErrors, CompiledErrors)
    ]


def bits_of(errors, times_ns):
    """Return the bits of what is shown at `times_ns` under a load that swings."""
    bits = b""
    for t_ns in times_ns:
        load = [20.0 * np.sin(1e-9 * t_ns + axis) for axis in range(6)]
        bits += struct.pack("6d", *errors.apply(t_ns, load))
    return bits


@pytest.mark.parametrize("scales", [(), (COARSE, STEPLESS)])
def test_samples_are_the_same_bits_over_many_blocks_of_numbers(scales):
    python, compiled = both(1, *scales)
    times_ns = range(0, 2500 * PERIOD_NS, PERIOD_NS)
    assert bits_of(python, times_ns) == bits_of(compiled, times_ns)
    assert python.warmth == compiled.warmth


def test_samples_at_an_uneven_pace_are_the_same_bits():
    python, compiled = both(2)
    steps_ns = np.random.default_rng(3).integers(0, 4 * PERIOD_NS, 500)
    times_ns = np.cumsum(steps_ns).tolist()
    assert bits_of(python, times_ns) == bits_of(compiled, times_ns)


def test_a_shift_and_another_generator_are_the_same_bits():
    python, compiled = both(4)
    bits: list[bytes] = []
    for errors in (python, compiled):
        shown = bits_of(errors, range(0, 100 * PERIOD_NS, PERIOD_NS))
        errors.shift = (1.0, 0.0, -2.0, 0.0, 0.1, 0.0)
        errors.draw_from(np.random.default_rng(5))
        later = range(100 * PERIOD_NS, 500 * PERIOD_NS, PERIOD_NS)
        bits.append(shown + bits_of(errors, later))
    assert bits[0] == bits[1]


def test_what_is_rounded_to_zero_has_no_sign():
    _, compiled = both(6, COARSE, COARSE)
    times_ns = range(0, 300 * PERIOD_NS, PERIOD_NS)
    shown = np.array([compiled.apply(t_ns, (-0.1,) * 6) for t_ns in times_ns])
    zeros = shown[shown == 0.0]
    assert len(zeros)
    assert not np.signbit(zeros).any()
