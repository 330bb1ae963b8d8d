"""One flipped sign or turned frame anywhere makes measured and true disagree.

A comparison with the simulated truth shows that frames, signs, tare and kinematics are
right; these tests show that the comparison can fail.
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

import analysis.data.load
import ft_sensor.payload
from analysis.data.load import load_trial
from experiments.report.truth_errors import compare_with_truth
from fakes.world import plain_world
from ft_sensor.payload import Payload
from tests.experiments.program import only_session, run_short, write_config
from wam.driver.transmission import Transmission

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

# m/s rms; N mean: three standard deviations of drift and bias of one trial
LARGEST_V, LARGEST_F = 1.5e-3, 1.0
# The wrist's rotation is nearly its own inverse where the foot stands upright: one that
# is turned backwards shows only where the foot is pressed hard.
PRESSED = ("virtual_mass = 0.30", "virtual_mass = 1.0")  # kg


class MismountedRig(plain_world.FakeRig):
    """A rig whose sensor is mounted otherwise than rig.toml states."""

    changes: ClassVar[dict] = {}

    def __init__(self, scene, constants, tool, clock, options=None, network=None):
        tool = replace(tool, **self.changes)
        super().__init__(scene, constants, tool, clock, options, network)


class TurnedRig(plain_world.FakeRig):
    """A rig whose container is turned by 30 degrees from the matrix."""

    def __init__(self, scene, *rest, **options):
        frame = replace(scene.frame, heading=scene.frame.heading + np.radians(30.0))
        super().__init__(replace(scene, frame=frame), *rest, **options)


def sensor(**changes):
    def apply(patch):
        patch.setattr(MismountedRig, "changes", changes)
        patch.setattr(plain_world, "FakeRig", MismountedRig)

    return apply


def container_turned(patch):
    patch.setattr(plain_world, "FakeRig", TurnedRig)


def joint_reversed(joint):
    """Reverse one joint in the driver, but not in the motors."""

    def apply(patch):
        right = Transmission.joints

        def wrong(self, counts):
            q = right(self, counts)
            q[joint - 1] = -q[joint - 1]
            return q

        patch.setattr(Transmission, "joints", wrong)

    return apply


def force_turned_backwards(patch):
    def wrong(self, wrench, rotation):
        turned = np.swapaxes(rotation, -1, -2)
        force = wrench[..., :3].dot(self.rotation.T)
        return np.matmul(turned, force[..., None])[..., 0]

    patch.setattr(Payload, "to_base", wrong)


def traction_with(*signs):
    """Multiply the projection onto the terrain's axes by these signs."""

    def apply(patch):
        right = ft_sensor.payload.traction

        def wrong(axes, velocity, force):
            return right(axes, velocity, force) * np.array(signs)

        patch.setattr(analysis.data.load, "traction", wrong)

    return apply


FLIPS = {
    "sensor sign": sensor(sensor_sign=-1.0),
    "sensor turned by a quarter": sensor(sensor_angle=np.pi / 2),
    "rotation of the force": force_turned_backwards,
    "sign of v_t": traction_with(-1.0, 1.0, 1.0),
    "sign of F_t": traction_with(1.0, -1.0, 1.0),
    "sign of F_n": traction_with(1.0, 1.0, -1.0),
    "heading of the container": container_turned,
    "direction of joint 2": joint_reversed(2),
    "direction of joint 6": joint_reversed(6),
}
QUICK = ("sensor sign", "sign of v_t")


def agrees(folder, flip=None):
    """Whether a recorded trial agrees with its truth; False without a trial."""
    config = write_config(folder, rig=PRESSED)
    with pytest.MonkeyPatch.context() as patch:
        if flip is not None:
            flip(patch)
        done = run_short(config, folder / "data", "S10")
        if done.code:
            return False
        path = only_session(folder / "data") / "trials" / "T01.mcap"
        errors = compare_with_truth(load_trial(path))
    assert errors is not None
    return errors.v_t < LARGEST_V and max(errors.F_t, errors.F_n) < LARGEST_F


def test_measurements_agree_with_the_truth_without_a_flip(tmp_path):
    assert agrees(tmp_path)


@pytest.mark.parametrize("what", QUICK)
def test_a_flipped_sign_is_noticed(tmp_path, what):
    assert not agrees(tmp_path, FLIPS[what])


@pytest.mark.long
@pytest.mark.parametrize("what", [name for name in FLIPS if name not in QUICK])
def test_every_flipped_sign_and_turned_frame_is_noticed(tmp_path, what):
    assert not agrees(tmp_path, FLIPS[what])
