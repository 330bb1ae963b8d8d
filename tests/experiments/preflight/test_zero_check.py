"""A wrong zero is noticed at the start if the encoder counts at home are known."""

import re

import numpy as np
import pytest

from acquisition.errors import PreflightError
from experiments.rig.rig import Rig
from tests.experiments.program import traction, write_config
from wam.driver.home import HOME_LIMIT, check_zero, zero_error
from wam.model.constants import load_constants

CONSTANTS = load_constants()
TURN = 4096
CTS = (TURN,) * 7
NOTED = np.array([1012, 340, 2761, 95, 4001, 1200, 2048])
TURNS = TURN / (2.0 * np.pi)
FIVE_DEGREES = float(np.radians(5.0))
JOINTS = range(1, 8)


def reported(q):
    """Positions [counts] reported by a well-zeroed arm at `q` [rad]."""
    return np.floor(TURNS * CONSTANTS.j2mp @ q + 0.5)


def mech(q):
    """Absolute encoder counts of an arm at `q` [rad]."""
    return (NOTED + reported(q) - TURNS * CONSTANTS.j2mp @ CONSTANTS.home) % TURN


def error_of(q, offset):
    """Zero error of an arm at `q` that reports `q + offset` [rad]."""
    return zero_error(CONSTANTS, CTS, reported(q + offset), mech(q), NOTED)


@pytest.mark.parametrize("seed", range(20))
def test_a_correct_zero_is_accepted_in_any_pose(seed):
    rng = np.random.default_rng(seed)
    q = rng.uniform(CONSTANTS.q_lower, CONSTANTS.q_upper)
    error = error_of(q, np.zeros(7))
    assert np.abs(error).max() < 0.1 * HOME_LIMIT
    check_zero(error)


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_wrong_zero_of_any_joint_is_refused_with_the_joint(joint, sign):
    offset = np.zeros(7)
    offset[joint - 1] = sign * FIVE_DEGREES
    q = np.array([0.1, 0.7, -0.2, 1.2, 0.3, 1.1, -0.4])
    with pytest.raises(
        PreflightError, match=rf"Joint {joint} is .*\(limit 0.03\)"
    ) as no:
        check_zero(error_of(q, offset))
    assert "traction zero" in no.value.hint


@pytest.mark.parametrize("joint", range(2, 7))
def test_the_size_of_a_zero_error_is_determined(joint):
    offset = np.zeros(7)
    offset[joint - 1] = FIVE_DEGREES
    error = error_of(np.zeros(7), offset)
    assert error[joint - 1] == pytest.approx(-FIVE_DEGREES, abs=1e-3)


def test_a_whole_turn_of_a_motor_is_not_detected():
    offset = np.zeros(7)
    offset[0] = 2.0 * np.pi / 42.0
    check_zero(error_of(np.zeros(7), offset))


def check_with(folder, patch, angles):
    """Check a simulated arm as if it were real and `angles` its counts at home."""
    patch.setattr(Rig, "is_simulated", property(lambda rig: False))
    line = f"mech_at_home = {[int(a) % TURN for a in angles]} # "
    config = write_config(folder, rig=("# mech_at_home = [...] ", line))
    options = ("--fake", "--fast", "--config", config, "--data", folder / "data")
    return traction("check", *options)


AT_HOME = np.floor(TURNS * CONSTANTS.j2mp @ CONSTANTS.home)


def test_the_preflight_page_confirms_a_correct_zero(tmp_path, monkeypatch):
    done = check_with(tmp_path, monkeypatch, AT_HOME)
    assert done.code == 0, done.err
    assert re.search(r"✔ zero +0\.000\d rad off at most", done.out)


def test_an_arm_zeroed_elsewhere_is_refused_by_check(tmp_path, monkeypatch):
    turned = np.zeros(7)
    turned[3] = FIVE_DEGREES
    angles = np.round(AT_HOME + TURNS * CONSTANTS.j2mp @ turned)
    done = check_with(tmp_path, monkeypatch, angles)
    assert done.code == 3
    assert done.err.startswith("Joint 4 is ")
    assert "traction zero" in done.err


@pytest.mark.parametrize(("more", "is_refused"), [(0.0, False), (1e-6, True)])
def test_a_zero_error_is_refused_beyond_the_limit_only(more, is_refused):
    error = np.zeros(7)
    error[4] = -HOME_LIMIT - more
    if not is_refused:
        check_zero(error)
        return
    with pytest.raises(PreflightError, match="Joint 5"):
        check_zero(error)
