"""C14: a sound sensor agrees with scales, one of another scale does not."""

import pytest

from experiments.commissioning import scales
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from tests.experiments.commissioning.held_arm import HeldArm
from wam.model.constants import GRAVITY


@pytest.fixture(scope="module")
def tool():
    return build_tool(load_settings(None).rig, "tread")


@pytest.mark.parametrize("seed", range(8))
def test_a_sound_sensor_agrees_with_scales(tool, seed):
    assert scales.judge(HeldArm(tool, seed).plate()).cause == ""


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_sensor_of_another_scale_is_reported(tool, seed):
    cause = scales.judge(HeldArm(tool, seed, "sensor-scale-95").plate()).cause
    assert "sensor reading minus kitchen scale" in cause


def test_a_scale_that_was_read_wrongly_is_reported(tool):
    cause = scales.judge(HeldArm(tool, 1).plate(3.8 * GRAVITY)).cause
    assert "the scale was read wrongly" in cause
