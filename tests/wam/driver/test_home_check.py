import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import PreflightError
from wam.driver.home import HOME_LIMIT, check_home, home_error
from wam.model.constants import load_constants

CONSTANTS = load_constants()
TURN = 4096
CTS = (TURN,) * 7
NOTED = (1012, 340, 2761, 95, 4001, 1200, 2048)


def mech_at(q):
    """Return MECH of an arm that is `q` [rad] away from the pose of NOTED."""
    counts = np.array(NOTED) + CONSTANTS.j2mp @ q * TURN / (2 * np.pi)
    return [int(c) for c in np.floor(counts + 0.5) % TURN]


@given(st.lists(st.floats(-0.05, 0.05), min_size=7, max_size=7))
def test_joint_errors_are_recovered_through_the_transmission(q):
    found = home_error(CONSTANTS.j2mp, CTS, mech_at(np.array(q)), NOTED)
    # half a count of each motor, through the differentials
    assert found == pytest.approx(q, abs=1e-4)


def test_an_arm_in_the_same_pose_has_no_error():
    assert not home_error(CONSTANTS.j2mp, CTS, NOTED, NOTED).any()


def test_a_whole_turn_is_not_observable():
    q = np.array([2 * np.pi / 42, 0, 0, 0, 0, 0, 0])
    found = home_error(CONSTANTS.j2mp, CTS, mech_at(q), NOTED)
    assert found == pytest.approx(np.zeros(7), abs=1e-4)


def test_encoders_of_another_resolution_are_scaled():
    noted, now = (0,) * 7, (400, 0, 0, 0, 0, 0, 0)
    coarse = home_error(CONSTANTS.j2mp, CTS, (40, *now[1:]), noted)
    fine = home_error(CONSTANTS.j2mp, (40960,) * 7, now, noted)
    assert fine == pytest.approx(coarse)
    assert fine[0] == pytest.approx(-2 * np.pi * 400 / 40960 / 42)


def test_the_worst_joint_is_reported_with_its_error():
    error = np.zeros(7)
    error[3] = -(HOME_LIMIT + 0.001)
    with pytest.raises(PreflightError, match=r"Joint 4 is -0\.031 rad .*limit 0\.03"):
        check_home(error)


def test_small_errors_pass():
    check_home(np.full(7, -(HOME_LIMIT - 0.001)))
    assert (
        np.pi / 42 > 2 * HOME_LIMIT
    )  # half a turn of the motor with the highest ratio


def test_an_error_at_the_limit_passes():
    check_home(np.full(7, HOME_LIMIT))
    with pytest.raises(PreflightError):
        check_home(np.full(7, HOME_LIMIT + 1e-6))
