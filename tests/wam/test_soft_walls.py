import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wam.constants import load_constants
from wam.soft_walls import DEPTH, SoftWalls, Walls

LIMIT = 10.0
WALLS = Walls((-1.0,) * 7, (2.0,) * 7, (LIMIT,) * 7, (5.0,) * 7)
STILL = np.zeros(7)


def armed():
    walls = SoftWalls(WALLS)
    assert walls.torque(np.zeros(7), STILL) is None
    return walls


def at(angle, joint=3):
    q = np.zeros(7)
    q[joint] = angle
    return q


def test_nothing_pushes_in_the_middle():
    assert armed().torque(np.full(7, 1.0), np.full(7, 3.0)) is None


@pytest.mark.parametrize(("stop", "sign"), [(-1.0, 1.0), (2.0, -1.0)])
def test_the_spring_pushes_inward_and_gives_half_the_limit_at_the_stop(stop, sign):
    tau = armed().torque(at(stop), STILL)
    assert tau[3] == pytest.approx(sign * LIMIT / 2)
    assert not np.delete(tau, 3).any()


def test_the_spring_begins_from_zero():
    tau = armed().torque(at(2.0 - DEPTH + 1e-6), STILL)
    assert abs(tau[3]) < 1e-3


def test_motion_into_the_wall_is_braked_and_motion_out_is_not():
    q, qd = at(1.95), np.zeros(7)
    still = armed().torque(q, STILL)[3]
    qd[3] = 0.5
    assert armed().torque(q, qd)[3] == pytest.approx(still - 0.5 * 5.0 * 0.5)
    qd[3] = -0.5
    assert armed().torque(q, qd)[3] == still


def test_a_joint_that_starts_in_its_wall_is_not_thrown_out():
    walls = SoftWalls(WALLS)
    assert walls.torque(at(2.05), STILL) is None
    assert walls.torque(at(1.92), STILL) is None
    walls.torque(at(1.5), STILL)
    assert walls.torque(at(1.95), STILL)[3] < 0


def test_each_joint_arms_its_own_walls():
    walls = SoftWalls(WALLS)
    q = at(1.95)
    walls.torque(q, STILL)
    q[5] = -0.95
    tau = walls.torque(q, STILL)
    assert tau[3] == 0.0
    assert tau[5] > 0.0


@given(
    st.lists(st.floats(-5, 5), min_size=7, max_size=7),
    st.lists(st.floats(-50, 50), min_size=7, max_size=7),
)
def test_a_wall_never_exceeds_the_limit_and_never_pushes_outward(q, qd):
    q = np.array(q)
    tau = armed().torque(q, np.array(qd))
    if tau is not None:
        assert np.abs(tau).max() <= LIMIT
        assert (tau[q > 1.0] <= 0).all()
        assert (tau[q < 0.0] >= 0).all()


def test_no_pose_of_the_shipped_matrix_touches_a_wall():
    from experiments.settings import load_settings

    constants = load_constants()
    for row in load_settings(None).matrix.terrains:
        q = np.array(row.start_q)
        assert (q > constants.q_lower + DEPTH).all()
        assert (q < constants.q_upper - DEPTH).all()
