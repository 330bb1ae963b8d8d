"""[gravity] of rig.toml: what the control law weighs, and what is refused."""

import dataclasses

import numpy as np
import pytest

from acquisition.errors import SettingsError
from acquisition.trial_file.reader import TrialReader
from experiments.rig.build import build_tool
from experiments.rig.law_calibrations import (
    build_law_model,
    gravity_words,
    read_law_calibrations,
)
from experiments.settings.load import load_settings
from tests.experiments.program import only_session, run_short, traction, write_config
from wam.calibration.gravity_file import GravityCalibration, gravity_to_toml
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.moments import gravity_torque, moments_of_links

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

CONSTANTS = load_constants()
POSES = np.random.default_rng(9).uniform(CONSTANTS.q_lower, CONSTANTS.q_upper, (10, 7))
# The bare foot of this rig weighs otherwise than the one with a tread.
LIGHTER = ("[feet.bare]\nmass = 0.45", "[feet.bare]\nmass = 0.38")


def use(model):
    return 'model = "cad"', f'model = "{model}"'


def calibration(rig, foot="tread", **changes):
    """Return the text of a calibration of an arm that is just as drawn."""
    tool = build_tool(rig, foot)
    found = GravityCalibration(
        mus=moments_of_links(CONSTANTS, (tool.sensor, tool.foot)),
        residual=0.02,
        rank=12,
        foot=foot,
        tool=tool,
        measured_utc="2027-01-15T08:00:00Z",
        is_simulated=True,
        poses=POSES,
        torques=np.zeros((10, 7)),
    )
    found = dataclasses.replace(found, **changes)
    held = [gravity_torque(CONSTANTS, found.mus, q) for q in POSES]
    return gravity_to_toml(dataclasses.replace(found, torques=np.array(held)))


@pytest.fixture
def folder(tmp_path):
    """Return a folder whose rig.toml uses the calibration beside it."""
    config = write_config(tmp_path, rig=use("calibrated"))
    config.write_text(config.read_text().replace(*LIGHTER))
    rig = load_settings(config).rig
    assert rig.feet["bare"].mass == 0.38
    (tmp_path / "gravity.toml").write_text(calibration(rig))
    return tmp_path


def law(folder, foot, *, is_simulated=True):
    settings = load_settings(folder / "rig.toml")
    text = read_law_calibrations(settings).gravity
    return build_law_model(settings.rig, text, foot, is_simulated=is_simulated)


@pytest.mark.parametrize("foot", ["tread", "bare"])
def test_a_calibration_serves_both_feet(folder, foot):
    rig = load_settings(folder / "rig.toml").rig
    truth = ArmModel(CONSTANTS, build_tool(rig, foot))
    model = law(folder, foot)
    for q in POSES:
        assert model.gravity(q) == pytest.approx(truth.gravity(q), abs=1e-11)


def test_the_feet_do_differ(folder):
    tread, bare = law(folder, "tread"), law(folder, "bare")
    differences = [tread.gravity(q) - bare.gravity(q) for q in POSES]
    assert np.abs(differences).max() > 0.3


def test_shipped_gravity_is_that_of_the_shipped_moments(tmp_path):
    settings = load_settings(write_config(tmp_path, rig=use("shipped")))
    model = build_law_model(settings.rig, "", "tread", is_simulated=True)
    tool = build_tool(settings.rig, "tread")
    bodies = moments_of_links(CONSTANTS, (tool.sensor, tool.foot))
    added = bodies - moments_of_links(CONSTANTS)
    for q in POSES:
        expected = gravity_torque(CONSTANTS, CONSTANTS.mus + added, q)
        assert model.gravity(q) == pytest.approx(expected, abs=1e-11)


def test_a_foot_that_was_weighed_anew_is_refused_with_its_old_weight(folder):
    config = folder / "rig.toml"
    config.write_text(config.read_text().replace("mass = 0.45", "mass = 0.46", 1))
    with pytest.raises(SettingsError) as caught:
        law(folder, "bare")
    assert "another tool: foot tread of 0.450 kg" in caught.value.message
    assert "calibrate gravity again" in caught.value.hint


def test_a_foot_that_rig_toml_has_not_is_refused(folder):
    path = folder / "gravity.toml"
    path.write_text(path.read_text().replace('foot = "tread"', 'foot = "claw"'))
    with pytest.raises(SettingsError, match="another tool: foot claw"):
        law(folder, "tread")


@pytest.mark.parametrize("was_simulated", [True, False])
def test_simulated_and_real_calibrations_do_not_mix(folder, was_simulated):
    rig = load_settings(folder / "rig.toml").rig
    text = calibration(rig, is_simulated=was_simulated)
    (folder / "gravity.toml").write_text(text)
    law(folder, "tread", is_simulated=was_simulated)
    with pytest.raises(SettingsError, match="was measured on a"):
        law(folder, "tread", is_simulated=not was_simulated)


def test_a_file_that_is_too_large_is_not_read(folder):
    (folder / "gravity.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(SettingsError, match="cannot be read"):
        read_law_calibrations(load_settings(folder / "rig.toml"))


def test_what_does_not_move_the_arm_needs_no_calibration(folder):
    (folder / "gravity.toml").unlink()
    config = folder / "rig.toml"
    done = traction("status", "--data", folder, "--config", config)
    assert done.code == 0


@pytest.mark.parametrize("model", ["mass", "CAD", ""])
def test_a_model_nobody_knows_is_refused(tmp_path, model):
    config = write_config(tmp_path, rig=use(model))
    with pytest.raises(SettingsError, match=r"gravity\.model = .* expected"):
        load_settings(config)


def test_the_preflight_says_which_foot_was_corrected(folder):
    settings = load_settings(folder / "rig.toml")
    text = read_law_calibrations(settings).gravity
    assert gravity_words(settings.rig, text, "tread") == (
        "calibrated 2027-01-15T08:00:00Z, rms 0.02 N m"
    )
    assert "from tread to bare" in gravity_words(settings.rig, text, "bare")


def test_a_trial_tells_its_gravity_and_keeps_the_file(folder, tmp_path):
    data = tmp_path / "data"
    done = run_short(folder / "rig.toml", data)
    assert done.code == 0, done.err
    trial = only_session(data) / "trials" / "T01.mcap"
    reader = TrialReader(trial)
    assert reader.metadata["trial"]["gravity_model"] == "calibrated"
    kept = reader.attachments["gravity.toml"].decode()
    assert kept == (folder / "gravity.toml").read_text()
    assert "gravity calibrated 2027" in done.out


def test_a_trial_by_the_drawings_says_so(first_trial):
    reader = TrialReader(first_trial)
    assert reader.metadata["trial"]["gravity_model"] == "cad"
    assert "gravity.toml" not in reader.attachments
