"""A calibration is checked at load by the criteria of the command that made it."""

import dataclasses

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from acquisition.errors import SettingsError
from experiments.rig.build import build_tool
from experiments.rig.law_calibrations import (
    LawCalibrations,
    build_compensation,
    build_law_model,
    forced_calibrations,
)
from experiments.settings.calibrations import with_calibrations
from experiments.settings.load import load_settings
from ft_sensor.calibration.files import terrain_to_toml
from ft_sensor.calibration.fit import SensorFit
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_to_toml
from ft_sensor.payload import TerrainFrame, payload_of
from tests.experiments.program import write_config
from tests.experiments.rig.test_friction_compensation import calibration as friction
from tests.experiments.rig.test_gravity import calibration as gravity
from wam.calibration.arm_identity import SerialNumbers, check_same_arm
from wam.calibration.friction_file import friction_from_toml, friction_to_toml
from wam.calibration.gravity_file import gravity_from_toml, gravity_to_toml
from wam.model.constants import load_constants
from wam.model.moments import gravity_torque

CONSTANTS = load_constants()
GRAVITY = ('model = "cad"', 'model = "calibrated"')
FRICTION = ('[friction]\nmodel = "none"', '[friction]\nmodel = "calibrated"')


def weighed(folder, damage, **changes):
    settings = load_settings(write_config(folder, rig=GRAVITY))
    stored = gravity_from_toml(gravity(settings.rig, **changes), "gravity.toml")
    text = gravity_to_toml(damage(stored))
    build_law_model(settings.rig, text, "tread", is_simulated=True)
    return forced_calibrations(settings, LawCalibrations(gravity=text))


def _heavier(stored):
    """A calibration that fits its torques, but of an implausible arm."""
    mus = stored.mus.copy()
    mus[1, 2] += 1.0
    change = np.array([_torques(mus - stored.mus, q) for q in stored.poses])
    return dataclasses.replace(stored, mus=mus, torques=stored.torques + change)


def _torques(mus, q):
    return gravity_torque(CONSTANTS, mus, q)


DAMAGES = {
    "large residual": (
        lambda s: dataclasses.replace(s, residual=9.9),
        "leave 9.90 N m unexplained",
    ),
    "low rank": (
        lambda s: dataclasses.replace(s, rank=3),
        "show 3 of 12 directions",
    ),
    "wrong torques": (
        lambda s: dataclasses.replace(s, torques=s.torques + 2.0),
        "leave 2.00 N m unexplained",
    ),
    "too few poses": (
        lambda s: dataclasses.replace(s, poses=s.poses[:1], torques=s.torques[:1]),
        "of 12 directions of gravity",
    ),
    "another arm": (_heavier, "N m from the drawings at joint 2"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_gravity_refused_by_its_command_is_refused_at_load(tmp_path, name):
    damage, words = DAMAGES[name]
    with pytest.raises(SettingsError, match="is no calibration to use") as refused:
        weighed(tmp_path, damage)
    assert words in refused.value.message
    assert "traction calibrate gravity again" in refused.value.hint


def test_forced_gravity_gives_a_warning(tmp_path):
    def damage(stored):
        return dataclasses.replace(stored, residual=0.7, is_forced=True)

    (words,) = weighed(tmp_path, damage)
    assert words.startswith("gravity.toml was forced. The torques leave 0.70 N m")


def test_sound_gravity_gives_no_warning(tmp_path):
    assert weighed(tmp_path, lambda stored: stored) == []


def rubbed(folder, **changes):
    settings = load_settings(write_config(folder, rig=FRICTION))
    stored = friction_from_toml(friction(), "friction.toml")
    fit = dataclasses.replace(stored.fit, **changes)
    text = friction_to_toml(dataclasses.replace(stored, fit=fit), CONSTANTS)
    return build_compensation(settings.rig, text, is_simulated=True)


def test_friction_refused_by_its_command_is_refused_at_load(tmp_path):
    assert rubbed(tmp_path) is not None
    with pytest.raises(SettingsError, match=r"does not fit motor 3: .* 0\.25"):
        rubbed(tmp_path, residual=np.array([0, 0, 0.25, 0, 0, 0, 0]))
    deviation = friction_from_toml(friction(), "f").fit.deviation
    deviation = deviation * np.array([1, 1, 1, 1, 30, 1, 1])
    with pytest.raises(SettingsError, match="motor 5 is hardly known"):
        rubbed(tmp_path, deviation=deviation)


def sensed(folder, residual, **changes):
    change = ("sign = 1 ", 'calibration = "ft_sensor.toml"\nsign = 1 ')
    settings = load_settings(write_config(folder, rig=change))
    payload = payload_of(build_tool(settings.rig, "tread"))
    fit = SensorFit(payload.mass, payload.com, np.zeros(6), 0.0, 1.0, residual, 0.001)
    stored = SensorCalibration(
        fit=fit,
        foot="tread",
        drift=0.1,
        measured_utc="2027-01-15T08:00:00Z",
        is_simulated=True,
        rotations=np.stack([np.eye(3)] * 6),
        readings=np.zeros((6, 6)),
        **changes,
    )
    (folder / "ft_sensor.toml").write_text(sensor_to_toml(stored))
    applied = with_calibrations(settings, is_simulated=True)
    return forced_calibrations(applied, LawCalibrations())


def test_a_sensor_refused_by_its_command_is_refused_at_load(tmp_path):
    assert sensed(tmp_path, 0.29) == []
    with pytest.raises(SettingsError, match=r"forces leave 0\.31 N rms unexplained"):
        sensed(tmp_path, 0.31)
    (words,) = sensed(tmp_path, 0.31, is_forced=True)
    assert words.startswith("ft_sensor.toml was forced. The forces leave 0.31 N")


def touched(folder, incline_deg, **facts):
    settings = load_settings(write_config(folder))
    frame = TerrainFrame(np.radians(incline_deg), 0.0, (0.7, 0.0, 0.19), 0.4)
    (folder / "s.toml").write_text(terrain_to_toml("S10", frame, facts))
    row = settings.row("S10").model_copy(update={"calibration": "s.toml"})
    applied = with_calibrations(settings.with_row(row), is_simulated=False)
    return forced_calibrations(applied, LawCalibrations())


def test_a_container_with_another_incline_is_refused_at_load(tmp_path):
    assert touched(tmp_path, 10.9) == []
    with pytest.raises(SettingsError, match=r"inclined by 11\.1 degrees, the matrix"):
        touched(tmp_path, 11.1)
    (words,) = touched(tmp_path, 11.1, forced="true")
    assert words.startswith("s.toml was forced")


ARM = (1201, 1202, 1203, 1204, 1205, 1206, 1207)


def test_a_calibration_of_another_arm_is_refused():
    check_same_arm("gravity.toml", ARM, ARM)
    check_same_arm("gravity.toml", None, ARM)
    check_same_arm("gravity.toml", ARM, (None,) * 7)
    with pytest.raises(SettingsError, match="with other pucks: puck 3 was 1203, is 9"):
        check_same_arm("gravity.toml", ARM, (1201, 1202, 9, 1204, 1205, 1206, 1207))
    with pytest.raises(SettingsError, match="with another arm: puck 1 was 1201, is 0"):
        check_same_arm("gravity.toml", ARM, range(7))


def test_the_serial_numbers_of_the_arm_are_read_as_written():
    rig = load_settings(None).rig
    stored = gravity_from_toml(gravity(rig, arm=ARM), "gravity.toml")
    assert stored.arm == ARM
    assert friction_from_toml(friction(arm=ARM), "friction.toml").arm == ARM
    assert gravity_from_toml(gravity(rig), "gravity.toml").arm is None


def test_serial_numbers_must_be_values_of_a_puck_property():
    numbers = TypeAdapter(SerialNumbers)
    most = (2**31 - 1,) * 7
    for valid in (most, (0,) * 7):
        assert numbers.validate_python(valid) == valid
    for wrong in (2**31, -1):
        with pytest.raises(ValidationError):
            numbers.validate_python((*most[:6], wrong))
