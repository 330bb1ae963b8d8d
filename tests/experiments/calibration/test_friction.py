"""The guided calibration of friction through the whole program."""

import signal
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from fakes.plant.model import PlantOptions
from fakes.world import plain_world
from tests.experiments.calibration.friction_errors import errors_of, verdicts
from tests.experiments.program import traction
from wam.calibration import excitation
from wam.model.friction import friction_of

SHARES, SEEDS = (0.2, 0.4, 1.0), (1, 2, 3, 4, 5)
pytestmark = [pytest.mark.long, pytest.mark.timeout(600)]


def calibrate(out, *options, press=None, is_quick=True):
    """Calibrate a simulated arm; the result of the command and the simulated rigs.

    Quick: around two poses instead of three, with one step of the plant per cycle.
    `press(asked, rig)` is called at every look at the keys.
    """
    made = []

    class WatchedRig(plain_world.FakeRig):
        def __init__(self, scene, constants, tool, clock, options=None, network=None):
            if is_quick:
                options = replace(options or PlantOptions(), substeps=1)
            super().__init__(scene, constants, tool, clock, options, network)
            made.append(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_world, "FakeRig", WatchedRig)
        if is_quick:
            patch.setattr(excitation, "CENTRES", 2)
        if press is not None:
            usual = AutoOperator.answer

            def answer(self, asked):
                press(asked, made[-1])
                return usual(self, asked)

            patch.setattr(AutoOperator, "answer", answer)
        arguments = ("calibrate", "friction", "--fake", "--fast", "--to", out)
        return traction(*arguments, *options), made


def read(folder):
    """Identified and true friction, as tables."""
    names = ("friction.toml", "friction.truth.toml")
    return [tomllib.loads((folder / name).read_text()) for name in names]


def errors(folder):
    return errors_of(folder / "friction.toml", folder / "friction.truth.toml")


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """(result of the command, folder, simulated rig) of one calibration."""
    folder = tmp_path_factory.mktemp("calibrated")
    out = folder / "friction.toml"
    done, made = calibrate(out, "--friction", 0.4, "--seed", 3)
    assert done.code == 0, done.out + done.err
    return done, folder, made[-1]


def test_the_friction_of_the_simulated_arm_is_identified(calibrated):
    found = errors(calibrated[1])
    assert found.coulomb.max() < 0.1
    assert found.asymmetry.max() < 0.2
    assert found.curve[:4].max() < 0.1
    assert found.curve[4:].max() < 0.2


def test_the_true_friction_is_that_of_the_simulated_arm(calibrated):
    _, folder, rig = calibrated
    true = friction_of(read(folder)[1]["motors"])
    assert (true.stribeck == rig.plant.friction.stribeck).all()
    assert (true.asymmetry == rig.plant.friction.asymmetry).all()


def test_the_operator_sees_the_friction_of_every_joint(calibrated):
    done = calibrated[0]
    assert "clear the space" in done.out
    for name in ("Coulomb", "asymmetry", "break-away", "at 0.01 rad/s", "at 0.4 rad/s"):
        assert name in done.out
    assert done.out.rstrip().endswith("ARM: idle; it sinks slowly, support it.")


def test_the_file_states_foot_gravity_and_lower_bounds(calibrated):
    found, _ = read(calibrated[1])
    assert (found["foot"], found["gravity"]) == ("tread", "cad")
    assert found["is_simulated"] is True
    bound = np.divide(found["coulomb_lower_bound"], found["coulomb"])
    assert (bound > 0.7).all()
    assert (bound < 1.0).all()


@pytest.mark.parametrize("seconds", [0.5, 3.0])
def test_ctrl_c_during_the_motion_writes_nothing_and_leaves_the_arm_idle(
    tmp_path, seconds
):
    def press(asked, rig):
        if asked.prompt is Prompt.MOVING and asked.since > seconds:
            signal.raise_signal(signal.SIGINT)

    done, made = calibrate(tmp_path / "friction.toml", press=press)
    assert done.code == 130
    assert "Nothing was written." in done.out
    assert made[-1].network.safety_mode is SafetyMode.IDLE
    assert not list(tmp_path.iterdir())


def test_an_arm_that_somebody_holds_is_stopped_and_nothing_is_written(tmp_path):
    def press(asked, rig):
        if asked.prompt is Prompt.MOVING and asked.since > 1.0:
            rig.plant.disturbance[1] = 40.0 * np.sin(rig.plant.t_ns * 1e-9 * 20.0)

    done, made = calibrate(tmp_path / "friction.toml", press=press)
    assert done.code in {3, 4}
    assert made[-1].network.safety_mode is SafetyMode.IDLE
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["friction.toml", "friction.truth.toml"])
def test_no_file_is_ever_overwritten(tmp_path, name):
    (tmp_path / name).write_text("mine")
    done, made = calibrate(tmp_path / "friction.toml")
    assert done.code == 2
    assert "never overwritten" in done.err
    assert not made
    assert (tmp_path / name).read_text() == "mine"


def test_a_share_of_friction_out_of_range_is_refused(tmp_path):
    done, made = calibrate(tmp_path / "friction.toml", "--friction", 3)
    assert done.code == 2
    assert "--friction" in done.err
    assert not made


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("share", SHARES)
def test_drawn_arms_are_identified_at_every_share_of_friction(tmp_path, share):
    found = []
    for seed in SEEDS:
        folder = tmp_path / str(seed)
        folder.mkdir()
        options = ("--friction", share, "--seed", seed)
        done, _ = calibrate(folder / "friction.toml", *options, is_quick=False)
        assert done.code == 0, done.out + done.err
        found.append(errors(folder))
    assert [each.name for each in verdicts(found) if not each.is_met] == []
