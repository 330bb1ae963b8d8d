"""Compiled steps of the grounds are those of Python, to the last bit and draw."""

import numpy as np
import pytest

from fakes.ground.terrain import FREE, RIM, Container, make_terrain
from fakes.kernels.choice import COMPILED, chosen_dynamics

if chosen_dynamics() != COMPILED:
    pytest.skip("nothing is compiled here", allow_module_level=True)
from fakes.ground.compiled.grounds import CompiledGround, compiled_ground

DT = 0.0005
GROUNDS = [("small", "tread"), ("big", "tread"), ("none", "tread"), ("none", "bare")]


def grounds(stones, foot, seed=3):
    """Return the same ground in Python and compiled, and their generators."""
    generators = np.random.default_rng(seed), np.random.default_rng(seed)
    drawn = [Container(make_terrain(stones, foot, 0.1, g)) for g in generators]
    return drawn[0], compiled_ground(drawn[1]), *generators


def walk(steps, seed, *, pace=0.05, lift_every=4000):
    """Yield motions of a sole that slips, is lifted, turns and hits a board."""
    rng = np.random.default_rng(seed)
    x = y = z = vx = 0.0
    turn = np.zeros(3)
    for i in range(steps):
        if i % 400 == 0:
            goal_v = rng.uniform(-pace, 4.0 * pace)
            goal_y = rng.uniform(-2.0, 2.0) * FREE
            goal_z = 1.5 * RIM if i % lift_every == 0 else rng.uniform(-0.006, 0.002)
        vx += 0.05 * (goal_v - vx)
        vy, vz = 5.0 * (goal_y - y), 20.0 * (goal_z - z)
        x, y, z = x + DT * vx, y + DT * vy, z + DT * vz
        x = 0.0 if x > 0.45 else x
        turn = 0.99 * turn + 0.02 * rng.standard_normal(3)
        yield x, y, z, vx, vy, vz, *turn.tolist()


@pytest.mark.parametrize(("stones", "foot"), GROUNDS)
def test_compiled_steps_do_to_the_foot_what_those_in_python_do(stones, foot):
    ground, compiled, _, _ = grounds(stones, foot)
    touched = beside = 0
    for motion in walk(20_000, seed=8):
        contact = ground.step(DT, motion)
        assert compiled.step(DT, motion) == contact
        touched += contact[2] > 0.0
        beside += abs(motion[1]) > FREE and contact[2] > 0.0
    assert touched > 5000
    assert beside > 100
    assert compiled.truth() == ground.truth()
    assert compiled.capacity(0.1, 4.0) == ground.capacity(0.1, 4.0)


@pytest.mark.parametrize("stones", ["small", "big"])
def test_draws_stay_in_order_through_breaks_shuffles_and_collapses(stones):
    ground, compiled, rng, other = grounds(stones, "tread")
    for motion in walk(40_000, seed=9, lift_every=9000):
        ground.step(DT, motion)
        compiled.step(DT, motion)
    releases = ground.truth()["releases"]
    assert compiled.truth()["releases"] == releases > 3
    jams = ground.ground.jams, compiled.ground.jams
    for sequence in jams:
        sequence.chances.give_back()
    assert other.bit_generator.state == rng.bit_generator.state


def test_a_foot_that_is_set_down_far_away_stands_anew_on_compiled_stones_too():
    ground, compiled, rng, other = grounds("small", "tread")
    stand = (0.02, 0.0, -0.004, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    aloft = (0.02, 0.0, 0.08, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    far = (0.30, 0.0, -0.006, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0)  # set down while it moves
    for motion in (*(stand,) * 100, *(aloft,) * 2100, *(far,) * 100):
        assert compiled.step(DT, motion) == ground.step(DT, motion)
    assert other.bit_generator.state == rng.bit_generator.state


def test_a_ground_of_another_kind_is_stepped_as_it_is():
    class Mirror:
        stiffness = 1.0

    mirror = Mirror()
    assert compiled_ground(mirror) is mirror
    assert isinstance(grounds("none", "bare")[1], CompiledGround)
