"""[gravity] of rig.toml sets the gravity model of the control law."""

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
# The bare foot of this rig is lighter than the one with a tread.
LIGHTER = ("[feet.bare]\nmass = 0.45", "[feet.bare]\nmass = 0.38")


def use(model):
    return 'model = "cad"', f'model = "{model}"'


def calibration(rig, foot="tread", **changes):
    """File of a calibration of an arm that agrees with its drawings."""
    tool = build_tool(rig, foot)
    fitted = GravityCalibration(
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
    fitted = dataclasses.replace(fitted, **changes)
    torques = [gravity_torque(CONSTANTS, fitted.mus, q) for q in POSES]
    return gravity_to_toml(dataclasses.replace(fitted, torques=np.array(torques)))


@pytest.fixture
def folder(tmp_path):
    """A folder whose rig.toml uses the calibration next to it."""
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


def test_the_gravity_of_both_feet_differs(folder):
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


def test_a_changed_foot_is_refused_with_its_calibrated_mass(folder):
    config = folder / "rig.toml"
    config.write_text(config.read_text().replace("mass = 0.45", "mass = 0.46", 1))
    with pytest.raises(SettingsError) as caught:
        law(folder, "bare")
    assert "another tool: foot tread of 0.450 kg" in caught.value.message
    assert "calibrate gravity again" in caught.value.hint


def test_a_calibration_of_an_unknown_foot_is_refused(folder):
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


def test_status_needs_no_calibration(folder):
    (folder / "gravity.toml").unlink()
    config = folder / "rig.toml"
    done = traction("status", "--data", folder, "--config", config)
    assert done.code == 0


@pytest.mark.parametrize("model", ["mass", "CAD", ""])
def test_an_unknown_model_is_refused(tmp_path, model):
    config = write_config(tmp_path, rig=use(model))
    with pytest.raises(SettingsError, match=r"gravity\.model = .* expected"):
        load_settings(config)


def test_the_preflight_names_a_corrected_foot(folder):
    settings = load_settings(folder / "rig.toml")
    text = read_law_calibrations(settings).gravity
    assert gravity_words(settings.rig, text, "tread") == (
        "calibrated 2027-01-15T08:00:00Z, rms 0.02 N m"
    )
    assert "from tread to bare" in gravity_words(settings.rig, text, "bare")


def test_a_trial_records_its_gravity_model_and_file(folder, tmp_path):
    data = tmp_path / "data"
    done = run_short(folder / "rig.toml", data)
    assert done.code == 0, done.err
    trial = only_session(data) / "trials" / "T01.mcap"
    reader = TrialReader(trial)
    assert reader.metadata["trial"]["gravity_model"] == "calibrated"
    kept = reader.attachments["gravity.toml"].decode()
    assert kept == (folder / "gravity.toml").read_text()
    assert "gravity calibrated 2027" in done.out


def test_a_trial_with_the_gravity_of_the_drawings_records_no_file(first_trial):
    reader = TrialReader(first_trial)
    assert reader.metadata["trial"]["gravity_model"] == "cad"
    assert "gravity.toml" not in reader.attachments
