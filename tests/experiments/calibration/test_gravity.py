"""The guided calibration of gravity through the whole program."""

import signal
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from experiments.calibration import gravity
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from experiments.run import pose_walk as walk
from fakes.plant.model import PlantOptions
from fakes.plant.plant import ArmPlant
from fakes.world import plain_world
from tests.experiments.program import traction, write_config
from wam.calibration import poses as calibration_poses
from wam.calibration.gravity_file import gravity_from_toml
from wam.model.arm_model import ArmModel
from wam.model.constants import Body, load_constants
from wam.model.moments import gravity_torque

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


def perturbed(constants):
    """An arm whose links weigh up to a quarter more or less, with shifted centres."""
    rng = np.random.default_rng(3)
    links = tuple(
        Body(
            link.mass * (1 + 0.25 * rng.uniform(-1, 1)),
            link.com + 0.02 * rng.uniform(-1, 1, 3),
            link.inertia,
        )
        for link in constants.links
    )
    return replace(constants, links=links)


class HeavierRig(plain_world.FakeRig):
    """A rig whose arm weighs otherwise than its drawings state."""

    made: ClassVar[list["HeavierRig"]] = []

    def __init__(self, scene, constants, tool, clock, options=None, network=None):
        # Nothing touches the ground, so one step per cycle is fine enough.
        arm, options = perturbed(constants), PlantOptions(substeps=1)
        self.truth = ArmModel(arm, tool)
        super().__init__(scene, arm, tool, clock, options, network)
        self.made.append(self)


def calibrate(out, *options, press=None, is_quick=True):
    """Calibrate a simulated arm; the result of the command and the simulated rig.

    `press(asked, rig)` is called at every look at the keys. Quick: the arm moves
    faster and less far, and stops for a shorter time, than a real one may.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_world, "FakeRig", HeavierRig)
        if is_quick:
            patch.setattr(walk, "SETTLE", 0.1)
            patch.setattr(gravity, "AVERAGE", 0.1)
            patch.setattr(calibration_poses, "POINT_SPEED", 0.6)
            patch.setattr(calibration_poses, "APPROACH_SPEED", 0.1)
            patch.setattr(calibration_poses, "REACH", 0.6 * calibration_poses.REACH)
        if press is not None:
            usual = AutoOperator.answer

            def answer(self, asked):
                press(asked, HeavierRig.made[-1])
                return usual(self, asked)

            patch.setattr(AutoOperator, "answer", answer)
        arguments = ("calibrate", "gravity", "--fake", "--fast", "--to", out)
        return traction(*arguments, *options), HeavierRig.made[-1]


def errors(text, rig):
    """RMS errors of torque [N m] with and without calibration, over 50 poses."""
    found = gravity_from_toml(text, "gravity.toml")
    constants = load_constants()
    rng = np.random.default_rng(5)
    poses = rng.uniform(constants.q_lower, constants.q_upper, (50, 7))
    wanted = np.array([rig.truth.gravity(q) for q in poses])
    given = np.array([gravity_torque(constants, found.mus, q) for q in poses])
    drawn = np.array([ArmModel(constants, rig.truth.tool).gravity(q) for q in poses])
    return [np.sqrt(np.mean((tau - wanted) ** 2)) for tau in (given, drawn)]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """(result of the command, text of the file, simulated rig) of one calibration."""
    out = tmp_path_factory.mktemp("calibrated") / "gravity.toml"
    done, rig = calibrate(out, "--poses", 3)
    assert done.code == 0, done.err
    return done, out.read_text(), rig


def test_torques_of_a_perturbed_arm_are_recovered_in_poses_not_measured(
    calibrated,
):
    with_it, without = errors(*calibrated[1:])
    assert with_it < 0.1
    assert without > 0.3  # the perturbation was worth a calibration


@pytest.mark.long
def test_the_calibration_at_full_length_recovers_the_torques(tmp_path):
    out = tmp_path / "gravity.toml"
    done, rig = calibrate(out, is_quick=False)
    assert done.code == 0, done.err
    assert errors(out.read_text(), rig)[0] < 0.1


@pytest.mark.long
def test_an_arm_with_full_friction_is_not_taken_for_stuck(
    tmp_path,
):
    """Its motors start at up to 1.4 of the friction while other joints swing."""
    arm = ("--friction", "1.0", "--seed", "1", "--fake", "--fast")
    out = ("--to", tmp_path / "gravity.toml", "--data", tmp_path)
    done = traction("calibrate", "gravity", "--force", *arm, *out)
    assert done.code == 0, done.err
    assert (tmp_path / "gravity.toml").is_file()


def test_the_operator_is_asked_to_clear_the_space_and_sees_the_rank(calibrated):
    done, _, _ = calibrated
    assert "clear the space" in done.out
    assert "rank 12 of 12" in done.out
    assert "SIMULATED" in done.out.splitlines()[0]
    assert done.out.rstrip().endswith("ARM: idle; it sinks slowly, support it.")


def test_the_simulated_hand_is_off_the_arm_during_the_motion(tmp_path):
    hands = []

    def press(asked, rig):
        if asked.prompt is Prompt.MOVING and asked.since > 0.5:
            hands.append(rig.plant.hand.is_holding)
            signal.raise_signal(signal.SIGINT)

    calibrate(tmp_path / "gravity.toml", press=press)
    assert hands == [False]


def test_ctrl_c_during_the_motion_writes_nothing_and_leaves_the_arm_idle(tmp_path):
    speeds = []

    def press(asked, rig):
        if asked.prompt is Prompt.MOVING and asked.since > 1.0:
            speeds.append(float(np.abs(rig.plant.qd).max()))
            signal.raise_signal(signal.SIGINT)

    done, rig = calibrate(tmp_path / "gravity.toml", press=press)
    assert done.code == 130
    assert speeds[0] > 0.1  # it was moving
    assert "Stopped as asked. Nothing was written." in done.out
    assert done.out.rstrip().endswith("ARM: idle; it sinks slowly, support it.")
    assert rig.network.safety_mode is SafetyMode.IDLE
    assert not list(tmp_path.iterdir())


def test_an_arm_that_is_disturbed_while_it_is_weighed_is_refused(tmp_path, monkeypatch):
    """The arm is pressed at rest only: in a move its motor would count as stuck."""
    resting = []
    rest = walk.PoseWalk.rest

    def rest_held(self, seconds):
        resting.append(True)
        try:
            return rest(self, seconds)
        finally:
            resting.clear()

    def press(asked, rig):
        wave = np.sin(rig.plant.t_ns * 1e-9 * 13.0) if resting else 0.0
        rig.plant.disturbance[3] = 5.0 * wave  # 10 mrad at the joint's stiffness

    monkeypatch.setattr(walk.PoseWalk, "rest", rest_held)
    done, rig = calibrate(tmp_path / "gravity.toml", "--poses", 3, press=press)
    assert done.code == 3, done.err
    assert "during the measurement (limit 0.02)" in done.err
    assert rig.network.safety_mode is SafetyMode.IDLE
    assert not list(tmp_path.iterdir())


def test_the_file_names_the_foot_that_was_fitted(calibrated):
    _, text, rig = calibrated
    found = gravity_from_toml(text, "gravity.toml")
    assert (found.foot, found.is_simulated) == ("tread", True)
    assert found.tool.foot.mass == rig.truth.tool.foot.mass
    assert found.poses.shape == found.torques.shape == (3, 7)


def test_a_missing_calibration_is_reported(tmp_path):
    use = ('model = "cad"', 'model = "calibrated"')
    config = write_config(tmp_path, rig=use)
    for options in (("--fake", "--fast"), ("--config-only",)):
        done = traction("check", *options, "--config", config)
        assert done.code == 2
        assert "gravity.toml cannot be read" in done.err


@pytest.mark.parametrize(
    "use",
    [
        ('model = "cad"', 'model = "calibrated"'),
        ('[friction]\nmodel = "none"', '[friction]\nmodel = "calibrated"'),
    ],
    ids=["gravity", "friction"],
)
def test_gravity_is_calibrated_before_the_files_of_rig_toml_exist(tmp_path, use):
    config = write_config(tmp_path, rig=use)

    def press(asked, rig):
        signal.raise_signal(signal.SIGINT)

    done, _ = calibrate(tmp_path / "g.toml", "--config", config, press=press)
    assert done.code == 130


def test_a_simulated_calibration_goes_to_a_marked_file_next_to_rig_toml(tmp_path):
    config = write_config(tmp_path)
    (tmp_path / "gravity.fake.toml").write_text("mine")
    done = traction("calibrate", "gravity", "--fake", "--fast", "--config", config)
    assert done.code == 2
    assert f"{tmp_path / 'gravity.fake.toml'} exists" in done.err


def test_a_file_is_never_overwritten(tmp_path):
    out = tmp_path / "gravity.toml"
    out.write_text("mine")
    done = traction("calibrate", "gravity", "--fake", "--fast", "--to", out)
    assert done.code == 2
    assert "never overwritten" in done.err
    assert out.read_text() == "mine"


def test_a_missing_folder_is_refused_before_the_arm_moves(tmp_path):
    out = tmp_path / "nowhere" / "gravity.toml"
    done = traction("calibrate", "gravity", "--fake", "--fast", "--to", out)
    assert done.code == 2
    assert "There is no folder" in done.err


@pytest.mark.parametrize("poses", [2, 61])
def test_a_number_of_poses_out_of_range_is_refused(poses):
    done = traction("calibrate", "gravity", "--fake", "--fast", "--poses", poses)
    assert done.code == 2
    assert "expected a whole number 3..60" in done.err


@pytest.mark.parametrize("option", [("--fast",), ("--operator-script", "auto")])
def test_options_of_a_simulation_are_refused_on_the_real_arm(option):
    done = traction("calibrate", "gravity", *option)
    assert done.code == 2
    assert "only with --fake" in done.err


def test_an_arm_that_was_zeroed_elsewhere_is_refused_with_the_joint(tmp_path):
    """Its encoders report joint 2 five degrees from its true position."""
    out, usual = tmp_path / "gravity.toml", ArmPlant.counts
    per_joint = np.array(load_constants().j2mp)[:, 1] * 4096 / (2 * np.pi)
    shift = np.round(np.radians(-5.0) * per_joint).astype(int)

    def counts(plant):
        pairs = zip(usual(plant), shift.tolist(), strict=True)
        return [true + lie for true, lie in pairs]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ArmPlant, "counts", counts)
        done, _ = calibrate(out, "--poses", 6)
    assert done.code == 2, done.err
    assert "Joint 2 seems to be zeroed +5." in done.err
    assert not out.exists()


def test_the_estimate_of_zero_errors_is_printed(calibrated):
    rows = calibrated[0].out.splitlines()
    (line,) = [row for row in rows if "zero errors estimated" in row]
    assert "joint 2" in line
    assert "1, 6 and 7 are not observable" in line


def test_a_calibration_with_a_hand_on_the_foot_is_refused(tmp_path):
    """A person leans on the foot from the second pose on; the torques look normal."""
    lean = (0.0, 3.0, -4.0)  # N

    def press(asked, rig):
        moving = asked.prompt is Prompt.MOVING and asked.since > 2.0
        rig.plant.finger = lean if moving else (0.0, 0.0, 0.0)

    out = tmp_path / "gravity.toml"
    done, rig = calibrate(out, "--poses", 3, press=press)
    assert done.code == 3, done.out
    assert "Something pushed the foot with 4.9 N" in done.err
    assert "Nothing was written." in done.err
    assert not out.exists()
    assert rig.plant.is_idle
