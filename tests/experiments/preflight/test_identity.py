"""Calibrations of another arm are refused before the arm is driven."""

from types import SimpleNamespace

import pytest

from acquisition.errors import PreflightError
from experiments.operator.console import BAD, GOOD
from experiments.preflight.identity import check_identity, serial_numbers
from experiments.rig.law_calibrations import LawCalibrations
from experiments.settings.load import load_settings
from experiments.settings.rig import ArmSection
from tests.experiments.program import write_config
from tests.experiments.rig.test_gravity import calibration

ARM = (1201, 1202, 1203, 1204, 1205, 1206, 1207)
REPAIRED = (*ARM[:6], 990)
USED = ('model = "cad"', 'model = "calibrated"')


def rig_of(folder, serials, *, arm=None, section=None):
    settings = load_settings(write_config(folder, rig=USED))
    text = calibration(settings.rig, arm=arm)
    rig = settings.rig.model_copy(update={"arm": section or ArmSection()})
    return SimpleNamespace(
        settings=SimpleNamespace(rig=rig),
        calibrations=LawCalibrations(gravity=text),
        serials=serials,
    )


def marks(rig):
    lines = []
    try:
        check_identity(rig, lambda *line: lines.append(line))
    except PreflightError as error:
        return [line[0] for line in lines], str(error)
    return [line[0] for line in lines], ""


def test_calibrations_of_this_arm_or_of_an_unnamed_one_are_used(tmp_path):
    assert marks(rig_of(tmp_path, ARM, arm=ARM)) == ([GOOD], "")
    assert marks(rig_of(tmp_path, ARM)) == ([GOOD], "")


def test_an_arm_without_serial_numbers_is_not_checked(tmp_path):
    assert marks(rig_of(tmp_path, None, arm=ARM)) == ([], "")


def test_gravity_of_another_arm_is_refused(tmp_path):
    grades, words = marks(rig_of(tmp_path, REPAIRED, arm=ARM))
    assert grades == [BAD]
    assert "gravity.toml was measured with other pucks: puck 7 was 1207" in words


def test_a_zero_of_another_arm_is_refused(tmp_path):
    section = ArmSection(mech_at_home=(1,) * 7, serial_numbers=ARM)
    words = marks(rig_of(tmp_path, REPAIRED, section=section))[1]
    assert "mech_at_home of rig.toml was measured with other pucks" in words


@pytest.mark.parametrize(
    ("serials", "is_simulated", "expected"),
    [(ARM, False, ARM), (ARM, True, None), ((None, *ARM[1:]), False, None)],
)
def test_only_a_real_arm_with_all_serial_numbers_has_an_identity(
    serials, is_simulated, expected
):
    info = SimpleNamespace(pucks=[SimpleNamespace(serial=number) for number in serials])
    assert serial_numbers(SimpleNamespace(is_simulated=is_simulated), info) == expected
