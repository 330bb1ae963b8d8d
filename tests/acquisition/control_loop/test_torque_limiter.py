import numpy as np
import pytest

from acquisition.control_loop.limits import bounded_torque

LIMITS = (20.0, 45.0, 15.0, 15.0, 2.5, 2.5, 1.3)
STEP = np.array(LIMITS) * ([0.1] * 6 + [0.3])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_torque_reaches_its_limit_at_the_slew_rate(sign):
    tau = np.zeros(7)
    for _ in range(9):
        tau = bounded_torque(sign * np.full(7, 99.0), tau, LIMITS)
    assert (np.abs(tau)[:6] < LIMITS[:6]).all()
    for _ in range(2):
        tau = bounded_torque(sign * np.full(7, 99.0), tau, LIMITS)
    assert tau.tolist() == [sign * limit for limit in LIMITS]


def test_a_small_change_passes_unchanged():
    last = np.array(LIMITS) / 2
    wanted = last - 0.9 * STEP
    assert bounded_torque(wanted, last, LIMITS).tolist() == wanted.tolist()


def test_each_joint_is_limited_separately():
    wanted = np.zeros(7)
    wanted[3] = 9.0
    assert bounded_torque(wanted, np.zeros(7), LIMITS).tolist() == [
        0,
        0,
        0,
        1.5,
        0,
        0,
        0,
    ]


def test_nan_passes_through_and_is_refused_by_the_driver():
    wanted = np.zeros(7)
    wanted[2] = np.nan
    assert np.isnan(bounded_torque(wanted, np.zeros(7), LIMITS)[2])


def test_the_largest_change_of_every_joint_is_its_share_of_the_limit():
    given = bounded_torque(np.full(7, 99.0), np.zeros(7), LIMITS)
    assert given == pytest.approx(STEP)


def test_a_change_beyond_the_step_is_limited():
    for more in (1.5, 1.001):
        for sign in (1.0, -1.0):
            given = bounded_torque(sign * more * STEP, np.zeros(7), LIMITS)
            assert given == pytest.approx(sign * STEP)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_torque_beyond_its_limit_is_clipped(joint, sign):
    most = sign * np.eye(7)[joint] * LIMITS
    assert bounded_torque(1.001 * most, most, LIMITS).tolist() == most.tolist()
