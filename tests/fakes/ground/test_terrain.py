import math

import numpy as np
import pytest

from fakes.ground.contact import NO_CONTACT
from fakes.ground.footing import Footing
from fakes.ground.stone_sizes import STONES, slope_factor
from fakes.ground.stones import StoneBed
from fakes.ground.terrain import PLATES, GroundChoice, Plate, make_terrain
from fakes.randomness import trial_generator

DT = 0.0005
SPEED = 0.04
PRESS = 6.0  # N
NO_TURN = (0.0, 0.0, 0.0)


def rng(seed=1):
    return np.random.default_rng(seed)


def standing(z):
    """Return the motion of a foot at rest at the far end."""
    return (0.0, 0.0, z, 0.0, 0.0, 0.0, *NO_TURN)


def drag(ground, *, travel, press=PRESS, speed=SPEED, mass=3.5):
    """Pull a pressed point foot along at constant speed; return rows F_t, F_n."""
    z, vz = ground.surface(0.0), 0.0
    rows = []
    for i in range(round(travel / speed / DT)):
        motion = (i * DT * speed, 0.0, z, speed, 0.0, vz, *NO_TURN)
        F_t, _, F_n, *_ = ground.step(DT, motion)
        vz += DT * (F_n - press) / mass
        z += DT * vz
        rows.append((F_t, F_n))
    return np.array(rows)


@pytest.mark.parametrize("foot", sorted(PLATES))
def test_a_plate_slides_with_its_friction(foot):
    plate = Plate(PLATES[foot], rng())
    truth = plate.truth()
    rows = drag(plate, travel=0.1, speed=0.1)[1000:]
    mu = (rows[:, 0].mean() - truth["b"] * 0.1) / rows[:, 1].mean()
    assert truth["mu_k"] == pytest.approx(PLATES[foot].mu_k, rel=0.08)  # 2 % a trial
    assert mu == pytest.approx(truth["mu_k"], rel=0.05)  # 3 % of texture
    assert rows[:, 1].mean() == pytest.approx(PRESS, rel=0.01)


def test_a_plate_sticks_better_than_it_slides():
    plate = Plate(PLATES["tread"], rng())
    slow = drag(plate, travel=0.01, speed=0.002)[2000:]
    p = PLATES["tread"]
    assert slow[:, 0].mean() / slow[:, 1].mean() > 0.5 * (p.mu_s + p.mu_k)


def test_a_plate_does_not_pull_a_lifted_foot():
    plate = Plate(PLATES["tread"], rng())
    assert plate.step(DT, (0.0, 0.0, 1e-6, 0.1, 0.1, 0.0, *NO_TURN)) == NO_CONTACT


def test_no_ground_ever_pulls_the_foot_down():
    for ground in (Plate(PLATES["bare"], rng()), StoneBed(STONES["big"], 0.0, rng())):
        z = ground.surface(0.0) - 1e-4
        away = (0.0, 0.0, z, 0.0, 0.0, 5.0, *NO_TURN)  # faster than the ground
        assert ground.step(DT, away)[2] == 0.0


def releases(F_t):
    """Return (peak, floor) of every sudden loss: more than half within 20 ms."""
    found = []
    i, window = 0, round(0.02 / DT)
    while i < len(F_t) - window:
        if F_t[i] > 3.0 and F_t[i + 1] < 0.6 * F_t[i]:
            found.append((F_t[i], F_t[i + 1 : i + window].min()))
            i += window
        i += 1
    return np.array(found)


@pytest.mark.parametrize("stones", ["small", "big"])
def test_a_bed_of_stones_loads_and_releases(stones):
    found, count = [], 0
    for seed in range(4):
        bed = StoneBed(STONES[stones], 0.0, rng(seed))
        # heavier than in a trial: the jam fails, not its hold on the foot
        rows = drag(bed, travel=0.45, press=8.0)
        found.append(releases(rows[:, 0]))
        count += bed.releases
    found = np.vstack(found)
    assert count >= 8
    assert len(found) >= 4
    # after a release only the rolling surface stones resist: mu 0.28
    assert np.median(found[:, 1] / found[:, 0]) < 0.3
    assert found[:, 0].max() < 4.0 * STONES[stones].J0


def test_a_bed_of_stones_supports_a_foot_at_rest():
    bed = StoneBed(STONES["small"], 0.0, rng())
    z = bed.surface(0.0) - 0.002
    for _ in range(2000):
        F_t, _, F_n, *_ = bed.step(DT, standing(z))
    assert F_n == pytest.approx(STONES["small"].k_n * 0.002)
    assert abs(F_t) < 0.3 * F_n  # the slope below the foot
    assert bed.releases == 0


def test_a_bed_sinks_only_under_a_moving_foot():
    still, moving = (StoneBed(STONES["big"], 0.0, rng(3)) for _ in range(2))
    low = still.surface(0.0)
    drag(moving, travel=0.05)
    for _ in range(1000):
        still.step(DT, standing(low - 0.002))
    deep = standing(low - 0.005)
    assert still.step(DT, deep)[2] > moving.step(DT, deep)[2] + 1.0


def test_a_foot_landing_elsewhere_meets_a_bed_that_has_not_sunk():
    bed, fresh = (StoneBed(STONES["big"], 0.0, rng(3)) for _ in range(2))
    drag(bed, travel=0.1)
    for _ in range(round(1.5 / DT)):
        bed.step(DT, standing(bed.surface(0.0) + 0.05))
    x = 0.1 + 2.0 * bed.away
    coming_down = (x, 0.0, bed.surface(x) - 0.003, SPEED, 0.0, 0.0, *NO_TURN)
    assert bed.step(DT, coming_down)[2] == fresh.step(DT, coming_down)[2]
    assert bed.sink == fresh.sink < 1e-5


def test_a_slope_weakens_a_bed():
    assert slope_factor(0.0) == 1.0
    factors = [slope_factor(math.radians(angle)) for angle in (5, 10, 15)]
    assert sorted(factors, reverse=True) == factors
    assert 0.7 < factors[-1] < 0.9


def pushed_aside(footing, by, F_n=PRESS):
    """Move the sole `by` [m] to its side; return the lateral force against y [N]."""
    return -footing.step(0.001, (0.0,) * 4 + (by / 0.001,) + (0.0,) * 4, 0.0, F_n, 0.6)[
        1
    ]


def test_a_bristle_stretches_to_its_limit_and_returns():
    footing, limit = Footing(2200.0, 0.0, 0.01, rng()), 0.6 * PRESS
    assert pushed_aside(footing, 0.001) == pytest.approx(2.2)
    assert pushed_aside(footing, 0.009) == pytest.approx(limit)
    assert pushed_aside(footing, -0.001) == pytest.approx(limit - 2.2)
    assert pushed_aside(footing, -0.009) == pytest.approx(-limit)


def test_pressing_does_not_restretch_a_slipped_bristle():
    footing = Footing(2200.0, 0.0, 0.01, rng())
    pushed_aside(footing, 0.01)
    slipped = pushed_aside(footing, 0.0, PRESS / 4)
    assert slipped == pytest.approx(0.6 * PRESS / 4)
    assert pushed_aside(footing, 0.0, PRESS) == slipped


def test_lifting_the_sole_resets_its_bristle():
    footing = Footing(2200.0, 0.0, 0.01, rng())
    aside = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0, *NO_TURN)
    assert footing.step(0.001, aside, 0.0, PRESS, 0.6)[1] == pytest.approx(-2.2)
    footing.release()
    still = standing(0.0)
    assert footing.step(0.001, still, 0.0, PRESS, 0.6)[1] == 0.0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_resistance_to_turning_is_bounded_by_the_normal_force(axis):
    footing = Footing(2200.0, 0.0, 0.01, rng())  # pressed at the centre of the sole
    rate = [0.0, 0.0, 0.0]
    rate[axis] = 1.0
    turn = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *rate)
    first = footing.step(0.001, turn, 0.0, PRESS, 0.6)[3:]
    assert first[axis] == pytest.approx(-10.0 * 0.001)
    for _ in range(100):
        last = footing.step(0.001, turn, 0.0, PRESS, 0.6)[3:]
    assert last[axis] == pytest.approx(-0.03 * PRESS)
    assert np.abs(last).sum() == pytest.approx(0.03 * PRESS)  # and about no other axis
    assert footing.step(0.001, turn, 0.0, 0.0, 0.6) == NO_CONTACT


def test_force_acts_at_the_centre_of_pressure():
    footing = Footing(2200.0, 0.010, 0.01, rng())
    for x in (0.0, 0.1, 0.2):
        aside = (x, 0.0, 0.0, 0.0, 0.002, 0.0, *NO_TURN)
        F_t, F_y, F_n, *moment = footing.step(DT, aside, 3.0, PRESS, 0.6)
        arm = (*footing.centre_of_pressure(x), 0.0)
        assert moment == pytest.approx(np.cross(arm, (-F_t, F_y, F_n)))
        assert arm[0] != 0.0


def test_the_centre_of_pressure_wanders_by_its_stated_spread():
    offsets = []
    for seed in range(10):
        footing = Footing(2200.0, 0.010, 0.01, rng(seed))
        track = np.linspace(0.0, 0.45, 451)
        offsets.append([footing.centre_of_pressure(x) for x in track])
    spread = np.array(offsets).std(axis=(0, 1))
    # 4.5 m of track have some 250 independent centimetres: 5 % at one sigma
    assert spread == pytest.approx([0.010, 0.010], rel=0.2)


@pytest.mark.parametrize("stones", ["small", "big", "none"])
def test_a_ground_is_reproducible_by_trial(stones):
    def forces(seed, trial):
        ground = make_terrain(
            GroundChoice(stones, "tread"), 0.1, trial_generator(seed, "S", trial)
        )
        return drag(ground, travel=0.02)

    assert forces(1, 1).tobytes() == forces(1, 1).tobytes()
    assert forces(1, 1).tobytes() != forces(1, 2).tobytes()
    assert forces(1, 1).tobytes() != forces(2, 1).tobytes()
