"""C5 to C7 on arms that are held still: sound ones pass, faulty ones fail."""

import pytest

from experiments.commissioning import manual_joints, weights
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from tests.experiments.commissioning.held_arm import HeldArm

SOUND = 40
WRONG = {  # faulty rig: possible texts of the first cause
    "zero-2-off-10deg": ("joint 2 on its stop",),
    "wrist-9.48": ("travel of joint",),
    "encoder-4-reversed": ("sense of joint 4",),
    "base-on-ceiling": ("The base is mounted differently",),
    "foot-heavier": ("mass of the foot",),
    "centre-off-50mm": ("centre of the foot",),
    "sole-20mm-lower": ("sole of rig.toml",),
    "sensor-turned-20deg": ("The sensor is turned", "it is turned", "the sensor about"),
    "sensor-sign": ("the sensor's sign",),
    "sensor-kgf": ("Units of the sensor",),
    "sensor-foreign-matrix": (
        "matrix belongs to another sensor",
        "The sensor is turned",
    ),
    "sensor-cable-pulls": ("its cable pulls",),
}


@pytest.fixture(scope="module")
def tool():
    return build_tool(load_settings(None).rig, "tread")


def causes(tool, seed, wrong=""):
    """Causes found by the three steps in turn, "" for a sound one."""
    arm = HeldArm(tool, seed, wrong)
    stops = arm.stops()
    yield manual_joints.judge(stops).cause
    yield weights.judge_own_weight(arm.own_weight()).cause
    off = manual_joints.stop_errors(stops)
    yield weights.judge_hung_weight(arm.hung_weight(off)).cause


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_arm_passes(tool, seed):
    assert list(causes(tool, seed)) == ["", "", ""]


@pytest.mark.long
def test_many_sound_arms_pass(tool):
    stopped = [seed for seed in range(SOUND) if any(causes(tool, seed))]
    assert stopped == []


@pytest.mark.slow
@pytest.mark.parametrize("wrong", WRONG)
def test_the_cause_of_a_faulty_arm_is_reported(tool, wrong):
    for seed in (1, 2, 3):
        cause = next(filter(None, causes(tool, seed, wrong)))
        assert any(words in cause for words in WRONG[wrong])
