"""Leading a foot around a closed path always costs energy."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fakes.ground.terrain import GroundChoice, make_terrain
from tests.sweeps import swept

DT = 0.0005
LIFTED, PRESS = 0.001, 4.0  # m, N
GROUNDS = [("small", "tread"), ("big", "tread"), ("none", "tread"), ("none", "bare")]


def lead(ground, corners, speed=0.02):
    """Lead the sole from corner to corner; return the work of the ground on it [J].

    Corners are x, y, z [m] and turns about them [rad]; 50 mm count as much as 1 rad.
    """
    path = [np.array(corners[:1])]
    for a, b in pairwise(corners):
        step = np.subtract(b, a)
        length = max(np.linalg.norm(step[:3]), 0.05 * np.linalg.norm(step[3:]))
        share = np.linspace(0.0, 1.0, 2 + int(length / speed / DT))[1:, None]
        path.append(np.asarray(a) + share * share * (3.0 - 2.0 * share) * step)
    poses = np.vstack(path)
    moves = np.diff(poses, axis=0)
    wrenches = []
    for pose, rate in zip(poses[:-1], moves / DT, strict=True):
        F_t, *rest = ground.step(DT, (*pose[:3], *rate))
        wrenches.append((-F_t, *rest))
    forces = np.array([*wrenches, [0.0] * 6])  # lifted at the end
    return float((0.5 * (forces[1:] + forces[:-1]) * moves).sum())


def closed_path(ground, *stations):
    """Go down at the first station, through all, up at the last, and back in the air.

    Stations are x, y, turn about x, y, z, and the force that presses [N].
    """
    top = ground.surface(0.0) + LIFTED
    pressed = [
        (x, y, ground.surface(x) - force / ground.stiffness, *turns)
        for x, y, *turns, force in stations
    ]
    over = (*pressed[0][:2], top, *pressed[0][3:])
    last = (*pressed[-1][:2], top, *pressed[-1][3:])
    return lead(ground, [over, *pressed, last, over])


def make_ground(stones, foot, seed):
    return make_terrain(
        GroundChoice(stones, foot), math.radians(5.0), np.random.default_rng(seed)
    )


HOME = (0.0, 0.0, 0.0, 0.0, 0.0, PRESS)
PATHS = {
    "slide": [HOME, (0.030, 0.0, 0.0, 0.0, 0.0, PRESS)],
    "there and back": [HOME, (0.020, 0.0, 0.0, 0.0, 0.0, PRESS), HOME],
    "stretch": [HOME, (0.0005, 0.0, 0.0, 0.0, 0.0, PRESS), HOME],
    "aside": [HOME, (0.0, 0.010, 0.0, 0.0, 0.0, PRESS), HOME],
    "turn": [HOME, (0.0, 0.0, 0.06, 0.06, 0.06, PRESS), HOME],
}


@pytest.mark.parametrize("path", sorted(PATHS))
@pytest.mark.parametrize(
    ("stones", "foot"), swept(GROUNDS, {("small", "tread"), ("none", "bare")})
)
def test_contact_creates_no_energy_over_a_closed_path(stones, foot, path):
    for seed in range(3):
        down_and_up = closed_path(make_ground(stones, foot, seed), HOME)
        around = closed_path(make_ground(stones, foot, seed), *PATHS[path])
        assert down_and_up < 0.0  # the bed damps
        # sums over steps are not exact: 0.1 mJ of the 1 mJ or more that a path costs
        assert around < down_and_up - 1e-4


@pytest.mark.parametrize(("stones", "foot"), GROUNDS)
@pytest.mark.parametrize("stretch", [0.0003, 0.0006, 0.002])
def test_a_light_touch_stores_no_energy_for_a_heavy_one(stones, foot, stretch):
    light = (stretch, 0.0, 0.0, 0.0, 0.0, 0.5)
    heavy = (stretch, 0.0, 0.0, 0.0, 0.0, 10.0)
    back = (stretch - 0.0005, 0.0, 0.0, 0.0, 0.0, 10.0)
    start = (0.0, 0.0, 0.0, 0.0, 0.0, 0.5)
    ground = make_ground(stones, foot, 0)
    assert closed_path(ground, start, light, heavy, back) < 0.0


@pytest.mark.parametrize(("stones", "foot"), GROUNDS)
def test_a_foot_at_rest_meets_an_equal_reaction(stones, foot):
    ground = make_ground(stones, foot, 1)
    z = ground.surface(0.0) - PRESS / ground.stiffness
    for _ in range(400):
        standing = (0.0, 0.0, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        _, F_y, F_n, *_ = ground.step(DT, standing)
    assert F_n == pytest.approx(PRESS)
    assert F_y == 0.0
