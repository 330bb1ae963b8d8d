"""How far apart two recorded pushes are."""

import numpy as np
import pytest

from lab.guest.ways import begun, farthest

CYCLES = 400


def push(speed, waits=20):
    """Joint positions [rad] that rest, then move at `speed` [rad per cycle]."""
    moved = speed * np.arange(1, CYCLES + 1)[:, None] * np.ones(7)
    return np.vstack([np.zeros((waits, 7)), moved])


def test_one_push_recorded_twice_is_nowhere_apart():
    assert farthest(begun(push(1e-3)), begun(push(1e-3))) == 0.0


@pytest.mark.parametrize("later", [1, 3, 200])
def test_a_key_that_came_later_makes_no_difference(later):
    one, other = push(1e-3), push(1e-3, 20 + later)
    assert farthest(begun(one), begun(other)) == pytest.approx(0.0, abs=1e-12)


def test_another_push_is_apart():
    # 250 cycles at twice the speed, of which a shift of ten can hide ten at most.
    assert farthest(begun(push(1e-3)), begun(push(2e-3))) > 0.2


def test_a_joint_that_jumps_once_shows():
    jumping = push(1e-3)
    jumping[150, 3] += 0.05
    # A shift of five cycles can hide 5 mrad of it.
    assert farthest(begun(push(1e-3)), begun(jumping)) >= 0.045 - 1e-9


def test_a_trial_without_a_push_is_comparable_with_none():
    still = np.zeros((CYCLES, 7))
    assert farthest(begun(still), begun(push(1e-3))) == float("inf")
