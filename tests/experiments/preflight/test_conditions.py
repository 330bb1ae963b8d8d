"""Session conditions, also of sessions recorded before some settings existed."""

import io
from contextlib import redirect_stdout

import pytest

from acquisition.errors import SessionError
from experiments.operator.console import Console
from experiments.preflight.conditions import (
    check_conditions,
    default_conditions,
    differences,
)
from experiments.session.recorded_conditions import (
    FILE,
    read_conditions,
    write_conditions,
)
from experiments.session.store import SessionFolder

DEFAULTS = default_conditions()
NOW = {**DEFAULTS, "rig.limits.foot_speed": "0.8", "terrain.foot": "tread"}
LATER = "rig.safety.torque_fault_units"  # a setting that older sessions lack


@pytest.fixture
def folder(tmp_path):
    return SessionFolder(tmp_path, "S001", "TF", is_simulated=True)


def check(folder, now, *, is_forced=False):
    with redirect_stdout(io.StringIO()):
        return check_conditions(folder, now, Console(), is_forced=is_forced)


def without(values, *names):
    return {name: value for name, value in values.items() if name not in names}


def test_conditions_are_read_as_written(folder):
    write_conditions(folder, NOW)
    assert read_conditions(folder) == NOW


def test_damaged_conditions_are_empty(folder):
    (folder.path / FILE).write_text("[")
    assert read_conditions(folder) == {}


def test_a_setting_newer_than_the_session_counts_as_its_default(folder):
    write_conditions(folder, without(NOW, LATER))
    assert check(folder, NOW) == []


def test_a_newer_setting_that_is_not_at_its_default_is_reported(folder):
    write_conditions(folder, without(NOW, LATER))
    with pytest.raises(SessionError, match=f"{LATER} was {DEFAULTS[LATER]}, is 4000"):
        check(folder, {**NOW, LATER: "4000"})


def test_a_whole_section_may_be_newer_than_the_session(folder):
    section = [name for name in NOW if name.startswith("rig.safety.")]
    write_conditions(folder, without(NOW, *section))
    assert len(section) > 2
    assert check(folder, NOW) == []


def test_a_missing_setting_without_a_default_is_a_difference(folder):
    write_conditions(folder, without(NOW, "rig.limits.foot_speed"))
    (text,) = check(folder, NOW, is_forced=True)
    assert text.startswith("rig.limits.foot_speed was not there")


def test_a_setting_that_no_longer_exists_is_ignored(folder):
    write_conditions(folder, {**NOW, "rig.limits.obsolete": "3"})
    assert check(folder, NOW) == []


def test_settings_of_the_operator_are_not_conditions():
    assert not [name for name in DEFAULTS if name.startswith("rig.operator.")]


def test_defaults_of_the_sensor_in_use_are_not_differences():
    assert default_conditions("bota")["rig.ft_sensor.calibration"] == "None"
    now = {"rig.ft_sensor.kind": "bota", "rig.ft_sensor.calibration": "None"}
    assert differences({"rig.ft_sensor.kind": "bota"}, now) == []
    assert differences({"rig.ft_sensor.sinc": "64"}, {}) == []


def test_a_changed_default_of_the_sensor_is_reported():
    now = {"rig.ft_sensor.kind": "bota", "rig.ft_sensor.calibration": "other.toml"}
    (text,) = differences({"rig.ft_sensor.kind": "bota"}, now)
    assert "rig.ft_sensor.calibration" in text


def test_a_newer_setting_of_a_foot_counts_as_its_default():
    shape = "rig.feet.round.shape"
    now = {**NOW, **default_conditions(feet=["round"])}
    assert now[shape] == "None"
    assert differences(without(now, shape), now) == []
    (text,) = differences(without(now, shape), {**now, shape: "point"})
    assert text == f"{shape} was None, is point"
