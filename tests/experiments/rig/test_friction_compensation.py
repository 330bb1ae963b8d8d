"""[friction] of rig.toml sets the compensation of the control law."""

import dataclasses
from datetime import UTC, datetime

import numpy as np
import pytest

from acquisition.errors import SettingsError
from acquisition.trial_file.reader import TrialReader
from experiments.rig.law_calibrations import (
    build_compensation,
    law_words,
    read_law_calibrations,
)
from experiments.settings.load import load_settings
from fakes.plant.friction import draw_friction
from tests.experiments.program import only_session, run_short, write_config
from wam.calibration.friction_file import FrictionCalibration, friction_to_toml
from wam.calibration.friction_fit import FrictionFit
from wam.control.friction_compensation import OSCILLATING_MOTOR, FrictionCompensation
from wam.model.constants import load_constants
from wam.model.friction import MotorFriction

CONSTANTS = load_constants()
MEASURED = datetime(2027, 1, 15, 8, tzinfo=UTC).isoformat()
USED = ('[friction]\nmodel = "none"', '[friction]\nmodel = "calibrated"')


def calibration(share=0.4, scale=1.0, **changes):
    """File of a calibration of an arm with a share of friction."""
    friction = draw_friction(CONSTANTS, share, None, np.zeros(7))
    friction = dataclasses.replace(friction, coulomb=scale * friction.coulomb)
    fit = FrictionFit(
        friction=friction,
        deviation=0.01 * friction.coulomb,
        asymmetry_deviation=0.01 * friction.coulomb,
        residual=np.full(7, 0.02),
        rows=(100,) * 7,
    )
    stored = FrictionCalibration(fit, "tread", "cad", MEASURED, is_simulated=True)
    return friction_to_toml(dataclasses.replace(stored, **changes), CONSTANTS)


@pytest.fixture
def folder(tmp_path):
    write_config(tmp_path, rig=USED)
    (tmp_path / "friction.toml").write_text(calibration())
    return tmp_path


def compensation(folder, *, is_simulated=True):
    settings = load_settings(folder / "rig.toml")
    text = read_law_calibrations(settings).friction
    return build_compensation(settings.rig, text, is_simulated=is_simulated)


def test_without_a_calibration_nothing_is_compensated(tmp_path):
    write_config(tmp_path)
    assert compensation(tmp_path) is None


def test_a_calibration_gives_the_law_a_compensation(folder):
    assert compensation(folder) is not None


def test_a_calibration_of_the_simulated_arm_is_refused_on_a_real_one(folder):
    with pytest.raises(SettingsError, match="simulated"):
        compensation(folder, is_simulated=False)


def test_a_missing_calibration_names_the_command_that_makes_it(folder):
    (folder / "friction.toml").unlink()
    with pytest.raises(SettingsError) as error:
        compensation(folder)
    assert "traction calibrate friction" in error.value.hint


def test_a_calibration_with_another_gravity_is_refused(folder):
    (folder / "friction.toml").write_text(calibration(gravity="shipped"))
    with pytest.raises(SettingsError, match="gravity shipped"):
        compensation(folder)


def test_implausible_friction_is_refused_with_its_joint(folder):
    (folder / "friction.toml").write_text(calibration(share=1.0, scale=3.0))
    with pytest.raises(SettingsError, match="joint 1"):
        compensation(folder)


@pytest.mark.parametrize("name", ["deviation", "asymmetry_deviation"])
def test_negative_deviations_are_refused(folder, name):
    text = calibration()
    lines = text.splitlines()
    index = next(i for i, line in enumerate(lines) if line.startswith(f"{name} ="))
    lines[index] = f"{name} = [-0.1, 0, 0, 0, 0, 0, 0]"
    (folder / "friction.toml").write_text("\n".join(lines))
    with pytest.raises(SettingsError, match="below 0"):
        compensation(folder)


@pytest.mark.parametrize("share", ["0.81", "-0.1", "nan", '"most"'])
def test_a_share_that_could_move_the_arm_is_refused(folder, share):
    rig = folder / "rig.toml"
    rig.write_text(
        rig.read_text().replace("compensation = 0.7", f"compensation = {share}")
    )
    with pytest.raises(SettingsError, match="compensation"):
        load_settings(rig)


def test_the_preflight_states_share_and_date(folder):
    settings = load_settings(folder / "rig.toml")
    words = law_words(settings.rig, read_law_calibrations(settings), "tread")
    assert "70%" in words
    assert "2027-01-15" in words


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_trial_records_calibration_and_share(folder):
    done = run_short(folder / "rig.toml", folder, "TF", 1, "--friction", "0.4")
    assert done.code == 0, done.err
    (path,) = (only_session(folder) / "trials").glob("T??.mcap")
    trial = TrialReader(path)
    assert trial.metadata["trial"]["friction_compensation"] == "0.7"
    assert trial.attachments["friction.toml"].decode() == calibration()
    cycles = trial.cycles().data
    excess = cycles["torque_command"] - cycles["torque_gravity"]
    assert np.abs(excess[:, 1]).max() > 0.2  # N m, at joint 2


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("motor", [0, 3])
def test_the_review_names_a_motor_that_ended_the_compensation(
    folder, monkeypatch, motor
):
    ended = {OSCILLATING_MOTOR: str(motor)}
    monkeypatch.setattr(FrictionCompensation, "metadata", lambda self: ended)
    done = run_short(folder / "rig.toml", folder, "TF", 1, "--friction", "0.4")
    assert done.code == 0, done.err
    assert ("motor 3 oscillated" in done.out) == (motor == 3)


def test_every_parameter_of_the_motors_is_in_the_file():
    text = calibration()
    assert all(f"{name} = [" in text for name in MotorFriction.__slots__)
