"""Sound rigs differ by seed in the stated properties."""

from dataclasses import replace

import numpy as np
import pytest

from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.model import PlantOptions
from fakes.world.deviation import (
    AXES,
    CABLE,
    CENTRE,
    GAINS,
    MASS,
    STOPS,
    TILT,
    ZEROS,
    RigDeviation,
    draw_sound_rig,
    rotated_axes,
)
from fakes.world.rig import FakeRig, SimulatedScene
from fakes.world.true_rig import true_constants, true_options, true_tool
from tests.fakes.scenes import CONSTANTS, FRAME, START_Q, TOOL, make_rig

RIGS = 300
DRAWN = [draw_sound_rig(seed) for seed in range(RIGS)]


def spread_of(values):
    """Return the standard deviation of a zero-mean quantity over many rigs."""
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(
    ("quantity", "scale"),
    [
        (lambda rig: rig.zeros, ZEROS),
        (lambda rig: rig.stops, STOPS),
        (lambda rig: rig.mount[:2], TILT),
        (lambda rig: rig.foot_mass - 1.0, MASS),
        (lambda rig: rig.foot_centre, CENTRE),
        (lambda rig: rig.cable, CABLE),
        (lambda rig: np.linalg.norm(rig.shown, axis=1) - 1.0, GAINS),
        (lambda rig: (rig.shown[0, 1] - rig.shown[1, 0]) / 2.0, AXES),
    ],
)
def test_sound_rigs_spread_as_stated(quantity, scale):
    values = [quantity(rig) for rig in DRAWN]
    # Three standard errors of a standard deviation of 300 values and more: 12 %.
    assert spread_of(values) == pytest.approx(scale, rel=0.125)
    assert abs(np.mean(values)) < 0.2 * scale


def test_the_spread_has_the_documented_scales():
    degrees = np.degrees([ZEROS, STOPS, TILT, AXES])
    assert degrees == pytest.approx([0.3, 0.7, 0.3, 0.5])
    assert (GAINS, MASS, CENTRE, CABLE) == (0.005, 0.005, 1e-3, 0.08)


def test_only_stated_properties_differ():
    rig, plain = DRAWN[3], RigDeviation()
    assert rig.mount[2] == 0.0
    for same in ("ratios", "links", "sole", "torque", "counts"):
        assert (np.array(vars_of(rig)[same]) == vars_of(plain)[same]).all()
    for same in ("friction", "torn", "properties", "versions", "module", "bus"):
        assert vars_of(rig)[same] == vars_of(plain)[same]


def vars_of(deviation):
    return {name: getattr(deviation, name) for name in deviation.__slots__}


def test_the_same_seed_is_the_same_rig():
    again = draw_sound_rig(7)
    assert (again.zeros == DRAWN[7].zeros).all()
    assert (again.shown == DRAWN[7].shown).all()
    assert (again.zeros != DRAWN[8].zeros).all()


def spread_rig(deviation):
    scene = SimulatedScene("S0", GroundChoice("small", "tread"), FRAME, START_Q, 5)
    scene = replace(scene, deviation=deviation)
    clock = SteppedClock()
    rig = FakeRig(scene, CONSTANTS, TOOL, clock)
    clock.attach(rig)
    return rig


def test_a_rig_without_deviations_is_nominal():
    rig, _ = make_rig(5)
    assert rig.plant.wiring is None
    assert (rig.plant.ends.lower == CONSTANTS.q_lower).all()
    rig.bus.shutdown()


def test_the_spread_changes_neither_ground_nor_hand_nor_friction():
    plain, _ = make_rig(5)
    spread = spread_rig(draw_sound_rig(5))
    assert spread.ground.truth() == plain.ground.truth()
    numbers = [rig.random.hand.random(5).tolist() for rig in (spread, plain)]
    assert numbers[0] == numbers[1]
    assert spread.plant.friction.coulomb == pytest.approx(
        plain.plant.friction.coulomb, rel=1e-3
    )
    for rig in (plain, spread):
        rig.bus.shutdown()


def test_zeros_offset_positions_and_stops_have_their_own_offset():
    sound = draw_sound_rig(5)
    rig = spread_rig(sound)
    turns = 2.0 * np.pi / np.array(CONSTANTS.cts)
    believed = np.linalg.solve(CONSTANTS.j2mp, turns * np.array(rig.plant.counts()))
    # A count is 0.15 mrad at least; two motors share a joint.
    assert believed - rig.plant.q == pytest.approx(sound.zeros, abs=2e-4)
    lower = np.minimum(CONSTANTS.q_lower, CONSTANTS.home) + sound.stops[0]
    assert rig.plant.ends.lower == pytest.approx(lower)
    rig.bus.shutdown()


def test_two_deviations_combine():
    first = RigDeviation(zeros=np.full(7, 0.1), foot_mass=1.1, friction=2.0)
    other = RigDeviation(zeros=np.full(7, 0.2), foot_mass=0.5, torn=2)
    both = other.on(first)
    assert both.zeros == pytest.approx(np.full(7, 0.3))
    assert (both.foot_mass, both.friction, both.torn) == (0.55, 2.0, 2)


def test_a_base_rotated_about_y_changes_the_gravity_direction():
    turned = RigDeviation(mount=np.radians([0.0, 90.0, 0.0]))
    down = true_options(PlantOptions(), turned).down
    # The z axis of the base lies along the true x: down is its own -z turned back.
    assert down == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)


def test_a_rotated_sensor_reads_a_rotated_load():
    shown = rotated_axes([0.0, 0.0, np.pi / 2]) @ [1.0, 0.0, 3.0, 0.0, 2.0, 0.0]
    assert shown == pytest.approx([0.0, -1.0, 3.0, 2.0, 0.0, 0.0], abs=1e-12)


def test_foot_and_links_have_their_stated_mass():
    deviation = RigDeviation(foot_mass=2.0, links=np.array([0.0, 0, 1, 0, 0, 0, 0]))
    assert true_tool(TOOL, deviation).foot.mass == 2.0 * TOOL.foot.mass
    links = true_constants(CONSTANTS, deviation).links
    more = [a.mass - b.mass for a, b in zip(links, CONSTANTS.links, strict=True)]
    assert more == pytest.approx([0, 0, 1, 0, 0, 0, 0])
