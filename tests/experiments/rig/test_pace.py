"""Stepped time is paced by the wall clock."""

import pytest

from experiments.rig.pace import WallPace
from fakes.clock import SteppedClock

TICK_NS = 20_000_000


@pytest.fixture
def world():
    return SteppedClock()


@pytest.fixture
def wall():
    return SteppedClock()


def let_pass(clock, ns):
    clock.sleep_until(clock.now_ns() + ns)


def test_a_simulation_that_is_ahead_waits_for_the_wall_clock(world, wall):
    pace, start_ns = WallPace(world, wall), wall.now_ns()
    for _ in range(100):
        let_pass(wall, TICK_NS // 4)  # duration of the simulation
        let_pass(world, TICK_NS)
        pace.keep()
    assert wall.now_ns() - start_ns == 100 * TICK_NS
    assert pace.speed == pytest.approx(1.0)


def test_a_simulation_that_is_a_little_late_catches_up(world, wall):
    pace, start_ns = WallPace(world, wall), wall.now_ns()
    let_pass(wall, 4 * TICK_NS)
    for _ in range(10):
        let_pass(world, TICK_NS)
        pace.keep()
    assert wall.now_ns() - start_ns == 10 * TICK_NS


def test_a_simulation_that_is_very_late_does_not_catch_up(world, wall):
    pace = WallPace(world, wall)
    let_pass(wall, 5_000_000_000)  # another program had the processor
    pace.keep()
    start_ns = wall.now_ns()
    for _ in range(50):
        let_pass(world, TICK_NS)
        pace.keep()
    assert wall.now_ns() - start_ns == 50 * TICK_NS


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_the_speed_on_a_slow_computer_is_its_share_of_real_time(world, wall, share):
    pace = WallPace(world, wall)
    for _ in range(500):
        let_pass(wall, round(TICK_NS / share))
        let_pass(world, TICK_NS)
        pace.keep()
    assert pace.speed == pytest.approx(share, rel=0.05)


def test_a_rest_neither_counts_as_slowness_nor_is_caught_up(world, wall):
    pace = WallPace(world, wall)
    pace.rest(60.0)
    start_ns = wall.now_ns()
    for _ in range(200):
        let_pass(world, TICK_NS)
        pace.keep()
    assert wall.now_ns() - start_ns == 200 * TICK_NS
    assert pace.speed == pytest.approx(1.0)
