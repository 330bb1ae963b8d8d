"""The twin of a rig: simulated as its calibrations say, whatever kind they are."""

import dataclasses
import tomllib

import numpy as np
import pytest

from acquisition.errors import SettingsError
from experiments.rig.fake import SimulatedRig
from experiments.rig.law_calibrations import read_law_calibrations, twin_words
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings
from tests.experiments.built import watch_builds
from tests.experiments.program import (
    journal,
    only_session,
    run_short,
    traction,
    write_config,
)
from tests.experiments.rig.test_friction_compensation import calibration as friction
from tests.experiments.rig.test_gravity import calibration as gravity
from wam.calibration.friction_file import friction_from_toml
from wam.calibration.gravity_file import gravity_from_toml
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

TWIN = FakeOptions("fast", seed=1, is_twin=True)
HEAVIER = np.full((7, 3), 0.01)  # kg m


@pytest.fixture
def folder(tmp_path):
    """Return a folder of a real rig: its arm is heavier and rubs more than nominal."""
    rig = load_settings(write_config(tmp_path)).rig
    stored = gravity_from_toml(gravity(rig), "gravity.toml")
    text = gravity(rig, mus=stored.mus + HEAVIER, is_simulated=False)
    (tmp_path / "gravity.toml").write_text(text)
    rubbed = friction(0.7, gravity="calibrated", is_simulated=False)
    (tmp_path / "friction.toml").write_text(rubbed)
    return tmp_path


def plant_of(folder, options=TWIN):
    """Return the simulated arm that a session would have."""
    settings = load_settings(folder / "rig.toml")
    with pytest.MonkeyPatch.context() as patch:
        built = watch_builds(patch)
        rig = build_rig(settings, settings.row("TF"), options)
    rig.backend.close()
    return built.rig.plant, rig


def body_of(folder):
    """Return what the simulation is told of the arm."""
    settings = load_settings(folder / "rig.toml")
    known = read_law_calibrations(settings, is_twin=True)
    row = settings.row("TF")
    return SimulatedRig(settings.rig, row, 1, 0.0, "steady", known).metadata()["body"]


def test_the_motors_of_a_twin_rub_as_calibrated(folder):
    plant, _ = plant_of(folder)
    stored = friction_from_toml((folder / "friction.toml").read_text(), "f")
    assert plant.friction.metadata() == stored.fit.friction.metadata()


def test_without_the_option_the_simulated_arm_is_one_of_its_own(folder):
    plant, _ = plant_of(folder, dataclasses.replace(TWIN, is_twin=False, friction=0.02))
    stored = friction_from_toml((folder / "friction.toml").read_text(), "f")
    assert (plant.friction.coulomb < 0.1 * stored.fit.friction.coulomb).all()


def test_joints_swing_on_their_cables_where_that_is_asked_for(tmp_path):
    write_config(tmp_path)
    plant, _ = plant_of(tmp_path, FakeOptions("fast", seed=1, cables=15.0))
    plant.short_windings([False] * 7)
    plant.advance(plant.t_ns + 100_000_000)
    turns = np.array(plant.counts()) / np.array(load_constants().cts)
    motors = np.linalg.solve(load_constants().j2mp, 2.0 * np.pi * turns)
    assert np.abs(motors - plant.q).max() > 2e-4  # more than a count


def test_a_twin_falls_under_gravity_that_the_drawings_do_not_have(folder):
    heavier, rig = plant_of(folder)
    drawn, _ = plant_of(folder, dataclasses.replace(TWIN, is_twin=False))
    speeds = []
    for plant in (heavier, drawn):
        plant.hand.let_go()
        plant.terrain = None
        plant.short_windings([False] * 7)
        motor = np.linalg.solve(
            rig.model.constants.j2mp.T, ArmModel.gravity(rig.model, plant.q)
        )
        plant.set_torques((motor * np.array(rig.model.constants.ipnm)).tolist())
        plant.advance(plant.t_ns + 20_000_000)
        speeds.append(np.abs(plant.qd).max())
    assert speeds[0] > 5 * speeds[1]


def test_what_is_not_calibrated_is_nominal_and_named(folder):
    (folder / "friction.toml").unlink()
    lines = twin_words(load_settings(folder / "rig.toml"))
    assert "gravity.toml" in lines[0]
    assert lines[1] == "not calibrated, so nominal: friction"


def test_friction_measured_with_a_gravity_that_is_gone_describes_no_arm(folder):
    (folder / "gravity.toml").unlink()
    with pytest.raises(SettingsError, match=r"gravity\.toml cannot be read"):
        twin_words(load_settings(folder / "rig.toml"))
    with pytest.raises(SettingsError, match=r"gravity\.toml cannot be read"):
        plant_of(folder)


def test_a_gravity_that_friction_was_not_measured_with_is_not_used(folder):
    rubbed = friction(0.7, gravity="cad", is_simulated=False)
    (folder / "friction.toml").write_text(rubbed)
    lines = twin_words(load_settings(folder / "rig.toml"))
    assert "gravity.toml" not in lines[0]
    assert lines[1].endswith("gravity.toml is not used")
    with_both = body_of(folder)
    (folder / "gravity.toml").unlink()
    assert with_both == body_of(folder)


def test_a_folder_without_calibrations_describes_no_arm(tmp_path):
    config = write_config(tmp_path)
    with pytest.raises(SettingsError, match="no calibration"):
        twin_words(load_settings(config))


def test_a_damaged_calibration_of_a_twin_is_named(folder):
    (folder / "friction.toml").write_text("[motors]\ncoulomb = 1\n")
    with pytest.raises(SettingsError, match=r"friction\.toml"):
        plant_of(folder)


def test_a_rehearsal_of_a_twin_takes_no_second_rig_toml(folder):
    done = traction("rehearse", "--twin", folder, "--config", folder / "rig.toml")
    assert done.code == 2
    assert "--twin and --config" in done.err


@pytest.mark.parametrize(
    "command", [("rehearse", "--twin"), ("run", "TF", "--fake", "--twin", "--config")]
)
def test_a_twin_that_rubs_as_calibrated_takes_no_other_share(command, folder):
    *words, option = command
    argument = folder if option == "--twin" else folder / "rig.toml"
    done = traction(
        *words, option, argument, "--friction", 0.5, "--data", folder / "data"
    )
    assert done.code == 2
    assert "--friction and --twin" in done.err


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_session_of_a_twin_stays_one_when_it_is_resumed(folder, monkeypatch):
    built = watch_builds(monkeypatch)
    config, data = folder / "rig.toml", folder / "data"
    fault = ("--fault", "estop@T01+0.3s")
    assert run_short(config, data, "TF", 1, "--twin", *fault).code == 4
    done = traction("resume", "--operator-script", "auto", "--data", data)
    assert done.code == 0, done.err
    coulomb = [rig.plant.friction.coulomb.tolist() for rig in built.rigs]
    assert len(coulomb) == 2
    assert coulomb[0] == coulomb[1]
    stored = tomllib.loads((folder / "friction.toml").read_text())
    assert coulomb[0] == stored["motors"]["coulomb"]
    assert journal(only_session(data))[0]["fake"]["is_twin"] is True
