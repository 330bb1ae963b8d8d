"""Friction that is compensated never makes a floating arm move by itself."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fakes.plant.friction import draw_friction
from tests.fakes.scenes import CONSTANTS
from tests.fakes.world.holding import HoldBench
from wam.control.friction_compensation import FrictionCompensation, FrictionLowerBound

pytestmark = pytest.mark.slow
NOTHING = np.zeros(7)
STILL = 2e-4  # rad in a second: an encoder's counts
KICK = 0.3  # rad/s


def over(motors, factor):
    """Return a compensation of `factor` times the friction."""
    level = factor * motors.coulomb
    return FrictionLowerBound(level, level, NOTHING, NOTHING, NOTHING)


def settled(motors, known, share=0.8, *, late=0, joint=1, grip="none", cables=None):
    """Kick a joint of a floating arm; return its positions in the sixth second.

    `grip`: "stiff" for a hand that carries, "loose" for a hand that lies on the arm.
    """
    compensation = FrictionCompensation(CONSTANTS, known, share)
    bench = HoldBench(
        compensation=compensation, motors=motors, late=late, cables=cables
    )
    if grip != "none":
        bench.plant.hand.carry()
    if grip == "loose":
        bench.plant.hand.rest()
    bench.throw(joint, KICK)
    bench.run(4.9)
    q = bench.run(1.0)
    assert bench.cycle.status.verdict is None
    assert compensation.oscillating_motor == 0
    return q


def whole(seed=None, presliding=1.0):
    friction = draw_friction(CONSTANTS, 1.0, seed, np.zeros(7))
    return replace(friction, presliding=presliding * friction.presliding)


def every(cases, *daily):
    """Return `cases` as parameters; all but `daily` are marked long."""
    return [
        pytest.param(*case, marks=[] if case in daily else pytest.mark.long)
        for case in cases
    ]


@pytest.mark.parametrize(
    ("joint", "late"),
    every(product(range(6), (0, 2)), *product((0, 1, 3, 5), (2,)), (1, 0)),
)
def test_overestimated_friction_causes_no_oscillation(joint, late):
    motors = whole()
    q = settled(motors, over(motors, 1.2), joint=joint, late=late)
    assert np.ptp(q, axis=0)[:6].max() < STILL


@pytest.mark.parametrize(
    ("joint", "presliding"),
    every(product((1, 3, 5), (0.25, 0.5, 2.0, 4.0)), (1, 0.25), (3, 4.0), (5, 0.25)),
)
def test_wrong_bristle_stiffness_causes_no_oscillation(joint, presliding):
    motors = whole(presliding=presliding)
    q = settled(motors, over(motors, 1.2), joint=joint, late=2)
    assert np.ptp(q, axis=0)[:6].max() < STILL


@pytest.mark.parametrize("joint", [1, 3])
def test_a_held_arm_does_not_oscillate(joint):
    motors = whole()
    q = settled(motors, over(motors, 1.2), joint=joint, grip="stiff")
    assert np.ptp(q, axis=0)[:6].max() < 5 * STILL


@pytest.mark.parametrize(
    ("cables", "joint", "grip"),
    every(
        product((8.0, 15.0, 20.0), (1, 3, 5), ("none", "loose", "stiff")),
        (8.0, 1, "none"),
        (15.0, 3, "loose"),
        (20.0, 5, "none"),
        (8.0, 3, "stiff"),
    ),
)
def test_elastic_cables_cause_no_oscillation(cables, joint, grip):
    motors = whole()
    known = over(motors, 1.2)
    q = settled(motors, known, joint=joint, grip=grip, cables=cables, late=2)
    assert np.ptp(q, axis=0)[:6].max() < (STILL if grip == "none" else 5 * STILL)
