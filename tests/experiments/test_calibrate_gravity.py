"""The guided calibration of gravity through the whole program."""

from dataclasses import replace

import numpy as np
import pytest

import fakes.rig
from experiments.calibrating import gravity
from tests.experiments.program import traction, write_config
from wam.constants import Body, load_constants
from wam.first_moments import gravity_torque
from wam.gravity_file import gravity_from_toml
from wam.model import ArmModel


def perturbed(constants):
    """Return an arm whose links weigh up to a quarter more or less, elsewhere."""
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


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """Return (what was printed, text of the file, true model) of one calibration."""
    folder = tmp_path_factory.mktemp("calibrated")
    seen = []

    class Heavier(fakes.rig.FakeRig):
        def __init__(self, scene, constants, tool, clock, *more, **options):
            constants = perturbed(constants)
            seen.append(ArmModel(constants, tool))
            super().__init__(scene, constants, tool, clock, *more, **options)

    out = folder / "gravity.toml"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fakes.rig, "FakeRig", Heavier)
        patch.setattr(gravity, "SETTLE", 0.5)
        done = traction(
            "calibrate", "gravity", "--fake", "--fast", "--poses", 4, "--out", out
        )
    assert done.code == 0, done.err
    return done, out.read_text(), seen[0]


def test_torques_of_a_perturbed_arm_are_recovered_where_nothing_was_measured(
    calibrated,
):
    _, text, truth = calibrated
    found = gravity_from_toml(text, "gravity.toml")
    constants = load_constants()
    rng = np.random.default_rng(5)
    poses = rng.uniform(constants.q_lower, constants.q_upper, (50, 7))
    wanted = np.array([truth.gravity(q) for q in poses])
    given = np.array([gravity_torque(constants, found.mus, q) for q in poses])
    uncorrected = np.array([ArmModel(constants, truth.tool).gravity(q) for q in poses])
    assert np.sqrt(np.mean((given - wanted) ** 2)) < 0.1
    assert np.sqrt(np.mean((uncorrected - wanted) ** 2)) > 0.3


def test_the_person_is_told_to_clear_the_space_and_sees_the_residuals(calibrated):
    done, _, _ = calibrated
    assert "clear the space" in done.out
    assert "rank 12 of 12" in done.out
    assert done.out.rstrip().endswith("ARM: idle, braked.")


def test_the_file_names_the_foot_that_was_fitted(calibrated):
    _, text, truth = calibrated
    found = gravity_from_toml(text, "gravity.toml")
    assert found.foot == "tread"
    assert found.tool["foot"]["mass"] == truth.tool.foot.mass


def test_a_calibration_is_used_and_refused_for_another_tool(calibrated, tmp_path):
    _, text, _ = calibrated
    use = ('model = "cad"', 'model = "calibrated"')
    config = write_config(tmp_path, rig=use)
    (tmp_path / "gravity.toml").write_text(text)
    options = ("check", "--fake", "--fast", "--config", config, "--data", tmp_path)
    assert traction(*options).code == 0
    config.write_text(config.read_text().replace("mass = 0.45", "mass = 0.50", 1))
    done = traction(*options)
    assert done.code == 2
    assert "gravity.toml was measured with another tool (foot tread)" in done.err


def test_a_missing_calibration_is_named(tmp_path):
    use = ('model = "cad"', 'model = "calibrated"')
    config = write_config(tmp_path, rig=use)
    done = traction("check", "--fake", "--fast", "--config", config)
    assert done.code == 2
    assert "gravity.toml cannot be read" in done.err


def test_a_file_is_never_overwritten(tmp_path):
    out = tmp_path / "gravity.toml"
    out.write_text("mine")
    done = traction("calibrate", "gravity", "--fake", "--fast", "--out", out)
    assert done.code == 2
    assert "never overwritten" in done.err
    assert out.read_text() == "mine"


@pytest.mark.parametrize("poses", [2, 61])
def test_a_silly_number_of_poses_is_refused(poses):
    done = traction("calibrate", "gravity", "--fake", "--fast", "--poses", poses)
    assert done.code == 2
    assert "expected a whole number 3..60" in done.err
