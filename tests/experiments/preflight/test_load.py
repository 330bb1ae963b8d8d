"""What the preflight says of the loads that this arm's friction leaves."""

import re

import pytest

from tests.experiments.program import traction, write_config
from tests.experiments.rig.test_friction_compensation import USED, calibration


def checked(folder, text, rig=None):
    """Return the page with a calibration beside rig.toml."""
    config = write_config(folder, rig=rig)
    if text is not None:
        (folder / "friction.toml").write_text(text)
    options = ("--fake", "--fast", "--config", config, "--data", folder / "data")
    return traction("check", *options)


def masses(done):
    """Return (mark, the three masses [kg])."""
    mark, text = re.search(r"(\S) load +(foot .*)", done.out).groups()
    return mark, [float(kg) for kg in re.findall(r"from (\d+\.\d\d)", text)]


def test_nothing_is_said_without_a_calibration(tmp_path):
    assert " load " not in checked(tmp_path, None).out


def test_the_masses_that_this_arm_can_render_are_printed(tmp_path):
    _, (down, half, tenth) = masses(checked(tmp_path, calibration(share=1.0)))
    assert (half, tenth) == pytest.approx((2.0 * down, 10.0 * down), abs=0.06)
    assert 0.5 < down < 1.3


def test_a_load_that_the_foot_may_not_bear_is_a_warning(tmp_path):
    assert masses(checked(tmp_path, calibration(share=1.0)))[0] == "▲"


def test_an_arm_that_hardly_rubs_bears_the_load_that_is_set(tmp_path):
    assert masses(checked(tmp_path, calibration(share=0.02)))[0] == "✔"


def test_compensation_lets_a_lighter_load_be_rendered(tmp_path):
    both = []
    for name, rig in (("without", None), ("with", USED)):
        (tmp_path / name).mkdir()
        done = checked(tmp_path / name, calibration(share=1.0), rig)
        both.append(masses(done)[1][0])
    assert both[1] < 0.6 * both[0]


def test_a_calibration_that_is_not_used_and_no_calibration_is_a_warning(tmp_path):
    done = checked(tmp_path, "nothing = 1\n")
    assert done.code == 0
    assert "▲ load" in done.out
    assert "is missing" in done.out


def test_a_calibration_of_a_real_arm_says_nothing_of_a_simulated_one(tmp_path):
    done = checked(tmp_path, calibration(share=1.0, is_simulated=False))
    assert done.code == 0
    assert " load " not in done.out
