"""Compiled errors and frames beside those in Python: the same to the last bit."""

import numpy as np
import pytest

from fakes.kernels.choice import COMPILED, chosen_dynamics
from fakes.pucks.ft_puck import SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS
from fakes.randomness import NormalArray, NormalStream
from fakes.sensor.bota import BotaOptions, bota_stream
from fakes.sensor.errors import FORCE_ERRORS, TORQUE_ERRORS, SensorErrors
from fakes.sensor.stream_faults import ByteFault

if chosen_dynamics() != COMPILED:
    pytest.skip("nothing is compiled here", allow_module_level=True)
from fakes.sensor.compiled import CompiledBotaStream, CompiledErrors

MS = 1_000_000
KINDS = {
    "serial": (FORCE_ERRORS, TORQUE_ERRORS),
    "on the bus": (SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS),
}
# What may happen to a stream, by name; `rng` chooses among its ways.
EVENTS = {
    "silence": lambda s, t, rng: s.go_silent(),
    "speech": lambda s, t, rng: s.speak(),
    "pause": lambda s, t, rng: s.pause(t + int(rng.integers(20 * MS))),
    "damage": lambda s, t, rng: s.damage_next(
        list(ByteFault)[rng.integers(3)], int(rng.integers(37))
    ),
    "clock": lambda s, t, rng: s.jump_clock(int(rng.integers(2**33))),
    "saturated": lambda s, t, rng: s.saturate(),
    "recovery": lambda s, t, rng: (s.recover(), s.receive(t, b"R")),
    "frozen clock": lambda s, t, rng: setattr(s, "is_clock_frozen", True),
    "status": lambda s, t, rng: setattr(s, "status", int(rng.integers(16))),
    "ranges": lambda s, t, rng: setattr(s, "ranges", (3.0,) * 6),
    "warming": lambda s, t, rng: setattr(s, "warming", 0.02),
    "frozen": lambda s, t, rng: s.faults.freeze(),
    "nonsense": lambda s, t, rng: setattr(s.faults, "is_nonsense", True),
    "garbled": lambda s, t, rng: setattr(s.faults, "is_garbled", True),
    "shift": lambda s, t, rng: setattr(s.errors, "shift", (rng.normal(),) * 6),
    "raked": lambda s, t, rng: s.errors.draw_from(
        np.random.default_rng(int(rng.integers(99)))
    ),
    "command": lambda s, t, rng: s.receive(
        t, [b"C", b"R", b"I", b"f,64,1,0,1", b"f,32,1,0,1", b"x"][rng.integers(6)]
    ),
    "reset": lambda s, t, rng: s.reset(t),
}


def pair(seed, scales=(), **options):
    """Return a stream in Python and one that is compiled, and the load they share."""
    load = [0.0] * 6
    chosen = BotaOptions(is_running=True, **{"sinc": 64, **options})
    streams = [
        bota_stream(
            lambda _: tuple(load), kind(np.random.default_rng(seed), *scales), chosen
        )
        for kind in (SensorErrors, CompiledErrors)
    ]
    return streams, load


def test_the_streams_differ_in_kind():
    (plain, compiled), _ = pair(1)
    assert isinstance(compiled, CompiledBotaStream)
    assert not isinstance(plain, CompiledBotaStream)


@pytest.mark.parametrize("seed", range(3))
def test_undisturbed_frames_are_the_same_bytes(seed):
    streams, load = pair(seed, clock_error_ppm=20.0)
    rng = np.random.default_rng(seed)
    count = 0
    for t_ns in range(0, 4_000 * MS, 2 * MS):
        load[:] = (0.99 * np.array(load) + rng.standard_normal(6)).tolist()
        expected, shown = (stream.due(t_ns) for stream in streams)
        assert shown == expected
        count += len(shown)
    assert count > 3_000
    assert streams[0].errors.warmth == streams[1].errors.warmth


@pytest.mark.parametrize("seed", range(6))
def test_whatever_happens_the_bytes_are_the_same(seed):
    options = {"sinc": (64, 0)[seed % 2], "raw_starts": seed % 3}
    streams, load = pair(seed, clock_error_ppm=50.0, **options)
    rng = np.random.default_rng([9, seed])
    names = list(EVENTS)
    said = 0
    for t_ns in range(0, 6_000 * MS, 2 * MS):
        load[:] = (0.99 * np.array(load) + rng.standard_normal(6)).tolist()
        if rng.random() < 0.04:
            name = "recovery" if rng.random() < 0.4 else names[rng.integers(len(names))]
            choice = int(rng.integers(2**30))
            for stream in streams:
                EVENTS[name](stream, t_ns, np.random.default_rng(choice))
        expected, shown = (stream.due(t_ns) for stream in streams)
        assert shown == expected
        said += len(shown)
        assert streams[0].next_event_ns() == streams[1].next_event_ns()
    assert said > 300


@pytest.mark.parametrize("kind", KINDS)
def test_errors_alone_are_the_same_at_any_pace(kind):
    both = [
        made(np.random.default_rng(4), *KINDS[kind])
        for made in (SensorErrors, CompiledErrors)
    ]
    rng = np.random.default_rng(5)
    t_ns = 0
    for _ in range(2_000):
        t_ns += int(rng.choice([0, 1, MS, 1_250_000, 30 * MS]))
        wrench = (5.0 * rng.standard_normal(6)).tolist()
        expected, shown = (errors.apply(t_ns, wrench) for errors in both)
        # To the sign of a zero: the frames show it.
        assert np.array(shown).tobytes() == np.array(expected).tobytes()


def test_an_array_of_normal_numbers_has_those_of_the_stream():
    stream = NormalStream(np.random.default_rng(2), block=16)
    array = NormalArray(np.random.default_rng(2), block=16)
    assert [array.next() for _ in range(50)] == [stream.next() for _ in range(50)]
    array.keep_ready(20)
    taken = array.taken[0]
    ahead = array.numbers[taken : taken + 20].tolist()
    assert ahead == [stream.next() for _ in range(20)]
