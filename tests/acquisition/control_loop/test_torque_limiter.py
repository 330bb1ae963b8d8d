import numpy as np
import pytest

from acquisition.control_loop.limits import MAX_TORQUE_STEP, limit_torque

LIMITS = (20.0, 45.0, 15.0, 15.0, 2.5, 2.5, 1.3)
STEP = np.array(LIMITS) * MAX_TORQUE_STEP


@pytest.mark.parametrize("sign", [1, -1])
def test_a_torque_reaches_its_limit_at_the_slew_rate(sign):
    tau = np.zeros(7)
    for cycle in range(1, 12):
        tau = limit_torque(sign * np.full(7, 99.0), tau, LIMITS)
        reached = np.minimum(cycle * STEP, LIMITS)
        assert sign * tau == pytest.approx(reached)
    assert tau.tolist() == [sign * limit for limit in LIMITS]


def test_a_small_change_passes_unchanged():
    last = np.array(LIMITS) / 2
    wanted = last - 0.9 * STEP
    assert limit_torque(wanted, last, LIMITS).tolist() == wanted.tolist()


def test_each_joint_is_limited_separately():
    wanted = np.zeros(7)
    wanted[3] = 9.0
    given = limit_torque(wanted, np.zeros(7), LIMITS)
    assert given.tolist() == [0, 0, 0, STEP[3], 0, 0, 0]


def test_nan_passes_through():
    wanted = np.zeros(7)
    wanted[2] = np.nan
    assert np.isnan(limit_torque(wanted, np.zeros(7), LIMITS)[2])


def test_a_change_beyond_the_step_is_limited():
    for more in (1.5, 1.001):
        for sign in (1.0, -1.0):
            given = limit_torque(sign * more * STEP, np.zeros(7), LIMITS)
            assert given == pytest.approx(sign * STEP)


@pytest.mark.parametrize(("joint", "sign"), [(0, 1.0), (3, -1.0), (6, 1.0)])
def test_a_torque_beyond_its_limit_is_clipped(joint, sign):
    limit = sign * np.eye(7)[joint] * LIMITS
    assert limit_torque(1.001 * limit, limit, LIMITS).tolist() == limit.tolist()
