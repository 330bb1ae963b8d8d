"""The client of a served arm sees the effect of hands and of wrong rigs."""

import numpy as np
import pytest

from experiments.operator.pendant import parse_order
from fakes.plant.model import PlantOptions
from fakes.world.deviation import RigDeviation, draw_sound_rig
from fakes.world.true_rig import true_options
from fakes.world.wrong_rigs import wrong_rig
from tests.fakes.scenes import CONSTANTS, MODEL, TOOL
from tests.fakes.serving.test_bare_arm import ServedArm
from tests.fakes.strict_client import HOME_Q

MS = 1_000_000
REST_6 = CONSTANTS.q_upper[5]


@pytest.fixture
def serve(tmp_path):
    """Return a function that serves an arm with a foot, started by its client."""
    opened = []

    def start(**found):
        arm = ServedArm(tmp_path, tool=TOOL, **found)
        opened.append(arm)
        arm.client.start()
        return arm

    yield start
    for arm in opened:
        arm.close()


def order(arm, line, seconds):
    parse_order(line.split()).give(arm.server.hands)
    arm.rest(round(1e9 * seconds))


def test_hands_pose_the_arm_as_read_by_its_client(serve):
    arm = serve(has_hand=True)
    order(arm, "pose 0.3 -1.8 0.1 2.9 0.2 0.8 0.1 1", 1.5)
    found = arm.client.read_joints()
    assert found == pytest.approx([0.3, -1.8, 0.1, 2.9, 0.2, 0.8, 0.1], abs=5e-3)


def test_a_joint_ends_at_its_stop(serve):
    arm = serve(has_hand=True, is_at_rest=True)
    order(arm, "stop 6 high", 1.0)
    # The arm was zeroed at rest, which its client takes for home.
    assert arm.server.hands.is_hand_done
    assert arm.client.read_joints()[5] == pytest.approx(HOME_Q[5], abs=0.01)
    order(arm, "pose 0 -2 0 3.13 0 0 0 1", 1.4)
    assert arm.client.read_joints()[5] == pytest.approx(HOME_Q[5] - REST_6, abs=0.01)


def test_a_released_arm_stays_while_supported(serve):
    arm = serve(has_hand=True)
    order(arm, "pose 0.3 -1.8 0 2.9 0 0.8 0 1", 1.3)
    order(arm, "release", 0.5)
    assert arm.client.read_joints()[1] == pytest.approx(-1.8, abs=5e-3)


def load(arm):
    hands = arm.server.hands
    return np.array(hands.sensor_load(hands.t_ns)), MODEL.sole_pose(hands.q)[1]


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (90.0, 0.0, 0.0)])
def test_a_hung_weight_pulls_vertically(serve, mount):
    deviation = RigDeviation(mount=np.radians(mount))
    arm = serve(has_hand=True, deviation=deviation)
    order(arm, "pose 0 -1.8 0 2.9 0 0.8 0 1", 1.4)
    free, _ = load(arm)
    order(arm, "hang 2", 0.4)
    hung, rotation = load(arm)
    down = np.array(true_options(PlantOptions(), deviation).down)
    assert rotation @ (hung - free)[:3] == pytest.approx(19.62 * down, abs=0.1)
    order(arm, "unhang", 0.4)
    assert load(arm)[0] == pytest.approx(free, abs=0.05)


def test_a_sound_arm_is_zeroed_despite_offset_zeros(serve):
    sound = draw_sound_rig(2)
    arm = serve(has_hand=True, deviation=sound)
    wanted = np.array([0.3, -1.8, 0.1, 2.9, 0.2, 0.8, 0.1])
    order(arm, "pose " + " ".join(map(str, wanted)) + " 1", 1.5)
    off = np.array(arm.client.read_joints()) - wanted
    free = [0, 2, 4, 5, 6]  # joints 2 and 4 stand on a stop at home
    assert off[free] == pytest.approx(sound.zeros[free], abs=5e-3)


def test_a_wrong_rig_is_served_with_its_deviation(serve):
    deviation = wrong_rig("encoder-4-reversed").deviation
    arm = serve(has_hand=True, deviation=deviation)
    order(arm, "pose 0 -1.8 0 2.9 0 0.8 0 1", 1.4)
    found = arm.client.read_joints()
    assert found[3] - HOME_Q[3] == pytest.approx(HOME_Q[3] - 2.9, abs=0.01)
