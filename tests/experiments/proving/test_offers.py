"""What C6 and C7 offer is what is wrong, as a value that makes it right."""

import re

import numpy as np
import pytest

from experiments.commissioning.steps import ProofStep
from experiments.proving import by_hand
from experiments.proving.offers import Mounted, offers_of
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from tests.experiments.proving.held_arm import HeldArm


@pytest.fixture(scope="module")
def tool():
    return build_tool(load_settings(None).rig, "tread")


def offered(tool, seed, wrong=""):
    """Return what is offered after C5 to C7 of an arm that is held still."""
    arm = HeldArm(tool, seed, wrong)
    off = by_hand.stop_errors(arm.stops())
    recordings = {
        ProofStep.OWN_WEIGHT: arm.own_weight(),
        ProofStep.HUNG_WEIGHT: arm.hung_weight(off),
    }
    mounted = Mounted("tread", tool.sensor_height, tool.sensor_angle)
    return offers_of(recordings, mounted)


def numbers(text, before):
    """Return the numbers that follow `before` in a text."""
    after = text.split(before, 1)[1]
    return [float(each) for each in re.findall(r"-?\d+\.\d+", after)]


def one(offers, words):
    """Return the one offer with these words."""
    (text,) = (each for each in offers if words in each)
    return text


@pytest.mark.slow
def test_a_foot_of_another_mass_is_offered_with_its_mass(tool):
    text = one(offered(tool, 1, "foot-half"), "feet.tread.mass = ")
    true = HeldArm(tool, 1, "foot-half").true_tool.foot.mass
    assert numbers(text, "mass = ")[0] == pytest.approx(true, rel=0.06)


@pytest.mark.slow
def test_another_sole_is_offered_with_its_place(tool):
    text = one(offered(tool, 1, "sole-20mm-lower"), "feet.tread.sole = ")
    true = HeldArm(tool, 1, "sole-20mm-lower").true_tool.sole
    assert numbers(text, "sole = ") == pytest.approx(true.tolist(), abs=0.004)


def test_a_turned_sensor_is_offered_with_its_angle(tool):
    text = one(offered(tool, 1, "sensor-turned-10deg"), "ft_sensor.angle_deg = ")
    turned = HeldArm(tool, 1, "sensor-turned-10deg").departure.shown[:2, :2]
    # What is shown is turned against the sensor: f_shown = Rz(-angle) f.
    angle = np.degrees(np.arctan2(turned[0, 1], turned[0, 0]))
    assert abs(angle) == pytest.approx(10.0, abs=2.0)
    assert numbers(text, "angle_deg = ")[0] == pytest.approx(angle, abs=2.5)


@pytest.mark.slow
def test_a_zero_that_is_off_is_offered_to_be_set_again(tool):
    text = one(offered(tool, 1, "zero-2-off-10deg"), "At home joint 2 tells")
    off = np.degrees(HeldArm(tool, 1, "zero-2-off-10deg").departure.zeros[1])
    assert abs(off) == pytest.approx(10.0, abs=1.0)
    assert ("more" if off > 0 else "less") in text
    assert numbers(text, "joint 2 tells ")[0] == pytest.approx(abs(off), abs=1.5)
    assert "traction zero" in text


@pytest.mark.slow
def test_a_tilted_base_is_told_though_rig_toml_has_no_value_for_it(tool):
    offers = offered(tool, 1, "base-tilted-5deg")
    assert "Level the base" in one(offers, "The base about")


@pytest.mark.slow
def test_a_scale_that_is_off_is_told(tool):
    text = one(offered(tool, 1, "sensor-scale-110"), "of a known weight")
    assert numbers(text, "shows ")[0] == pytest.approx(1.1, abs=0.03)


def test_of_sound_arms_little_is_offered(tool):
    offers = [text for seed in range(4) for text in offered(tool, seed)]
    assert not [text for text in offers if "feet." in text]
    assert len(offers) <= 4
