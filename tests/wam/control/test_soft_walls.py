from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.devices import ArmReading
from experiments.rig.build import terrain_frame
from experiments.settings.load import load_settings
from fakes.world.rig import solve_start
from wam.control.soft_walls import DEPTH, SoftWalls, Walls
from wam.model.constants import load_constants

LIMIT = 10.0
WALLS = Walls((-1.0,) * 7, (2.0,) * 7, (LIMIT,) * 7, (5.0,) * 7)
STILL = np.zeros(7)


def seen(q, qd=STILL, *, is_complete=True):
    return ArmReading(
        host_ns=0,
        arm_ns=0,
        counts=[0] * 7,
        q=np.array(q),
        qd=np.array(qd),
        qd7_raw=0.0,
        fresh=0x7F,
        is_complete=is_complete,
        missing_cycles=0,
    )


def pushed(walls, q, qd=STILL, tau=STILL):
    """Return `tau` plus the torques of the walls."""
    result = np.array(tau, dtype=float)
    walls.apply(result, seen(q, qd))
    return result


def armed():
    walls = SoftWalls(WALLS)
    assert not pushed(walls, STILL).any()
    return walls


def at(angle, joint=3):
    q = np.zeros(7)
    q[joint] = angle
    return q


def test_no_wall_acts_in_mid_range():
    assert not pushed(armed(), np.full(7, 1.0), np.full(7, 3.0)).any()


@pytest.mark.parametrize(("stop", "sign"), [(-1.0, 1.0), (2.0, -1.0)])
def test_the_spring_pushes_inward_up_to_its_share_of_the_limit(stop, sign):
    tau = pushed(armed(), at(stop))
    assert tau[3] == pytest.approx(sign * LIMIT / 2)
    assert not np.delete(tau, 3).any()


@pytest.mark.parametrize(("stop", "sign"), [(-1.0, 1.0), (2.0, -1.0)])
def test_the_spring_begins_from_zero(stop, sign):
    tau = pushed(armed(), at(stop + sign * (DEPTH - 1e-6)))
    assert 0.0 < sign * tau[3] < 1e-3


def test_motion_into_the_wall_is_damped_and_motion_out_is_not():
    q, qd = at(1.95), np.zeros(7)
    still = pushed(armed(), q)[3]
    qd[3] = 0.5
    assert pushed(armed(), q, qd)[3] == pytest.approx(still - 0.5 * 5.0 * 0.5)
    qd[3] = -0.5
    assert pushed(armed(), q, qd)[3] == still


def test_a_joint_starting_inside_a_wall_is_not_ejected():
    walls = SoftWalls(WALLS)
    assert not pushed(walls, at(2.05)).any()
    assert not pushed(walls, at(1.92)).any()
    pushed(walls, at(1.5))
    assert pushed(walls, at(1.95))[3] < 0


def test_an_extrapolated_position_arms_nothing():
    walls = SoftWalls(WALLS)
    walls.apply(np.zeros(7), seen(at(1.5), is_complete=False))
    assert pushed(walls, at(1.95))[3] == 0.0


def test_at_home_on_the_stops_walls_arm_later_without_a_kick():
    constants = load_constants()
    walls = SoftWalls(
        Walls(
            tuple(constants.q_lower.tolist()),
            tuple(constants.q_upper.tolist()),
            (LIMIT,) * 7,
            (5.0,) * 7,
        )
    )
    assert not pushed(walls, constants.home).any()
    out = constants.home + np.array([0.0, 0.11, 0.0, -0.14, 0.0, 0.0, 0.0])
    assert not pushed(walls, out).any()
    tau = pushed(walls, constants.home)
    assert tau[1] > 0.0
    assert tau[3] < 0.0


def test_each_joint_arms_its_own_walls():
    walls = SoftWalls(WALLS)
    q = at(1.95)
    pushed(walls, q)
    q[5] = -0.95
    tau = pushed(walls, q)
    assert tau[3] == 0.0
    assert tau[5] > 0.0


@pytest.mark.parametrize(("tau", "expected"), [(-4.0, -9.0), (-8.0, -9.5), (4.0, -1.0)])
def test_the_total_torque_in_a_wall_stays_within_the_limit(tau, expected):
    assert pushed(armed(), at(2.0), tau=at(tau))[3] == pytest.approx(expected)


def test_a_wall_does_not_reduce_a_torque_beyond_the_limit():
    assert pushed(armed(), at(2.0), tau=at(-12.0))[3] == -12.0


@given(
    st.lists(st.floats(-5, 5), min_size=7, max_size=7),
    st.lists(st.floats(-50, 50), min_size=7, max_size=7),
    st.floats(-LIMIT, LIMIT),
)
def test_a_wall_never_exceeds_the_limit_and_never_pushes_outward(q, qd, before):
    tau = pushed(armed(), q, qd, np.full(7, before))
    added = tau - before
    assert np.abs(tau).max() <= LIMIT
    assert (added[np.array(q) > 1.0] <= 0).all()
    assert (added[np.array(q) < 0.0] >= 0).all()


def test_no_trial_of_the_shipped_matrix_touches_a_wall(foot_model):
    constants = foot_model.constants
    for row in load_settings(None).matrix.terrains:
        q = np.array(row.start_q)
        frame = terrain_frame(row)
        for height in (0.06, 0.0):  # carried to the far end, then pushed across
            for along in np.linspace(0.0, row.travel, 10):
                x, y, z = (np.array(frame.start) + along * frame.axes()[0]).tolist()
                q = solve_start(foot_model, replace(frame, start=(x, y, z)), q, height)
                assert (q > constants.q_lower + DEPTH).all()
                assert (q < constants.q_upper - DEPTH).all()


def test_the_damper_of_a_wall_has_its_configured_gain():
    """The damper acts fully at the stop, and by half at half the depth."""
    damping, speed = 3.0, -0.4
    walls = SoftWalls(Walls((-1.0,) * 7, (1.0,) * 7, (1e3,) * 7, (damping,) * 7))
    pushed(walls, np.zeros(7))  # armed in the middle
    qd = np.array([speed, *np.zeros(6)])
    for depth, share in ((DEPTH, 1.0), (DEPTH / 2, 0.5)):
        q = np.array([-1.0 + DEPTH - depth, *np.zeros(6)])
        braked = pushed(walls, q, qd)[0] - pushed(walls, q)[0]
        assert braked == pytest.approx(-share * damping * speed)


def test_the_damper_is_constant_beyond_the_stop():
    damping, speed = 3.0, -0.4
    walls = SoftWalls(Walls((-1.0,) * 7, (1.0,) * 7, (1e3,) * 7, (damping,) * 7))
    pushed(walls, np.zeros(7))
    q, qd = at(-1.0 - DEPTH / 2), at(speed)
    assert pushed(walls, q, qd)[3] - pushed(walls, q)[3] == pytest.approx(
        -damping * speed
    )


@pytest.mark.parametrize("joint", range(7))
def test_no_wall_is_armed_at_first(joint):
    assert not pushed(SoftWalls(WALLS), at(1.95, joint)).any()


@pytest.mark.parametrize(("stop", "sign"), [(-1.0, 1.0), (2.0, -1.0)])
def test_the_slightest_penetration_of_a_wall_is_resisted(stop, sign):
    inside = stop + sign * (DEPTH - 0.002)
    assert pushed(armed(), at(inside))[3] == pytest.approx(sign * LIMIT / 0.2 * 0.002)


def test_the_depth_has_the_sign_of_the_wall():
    walls = SoftWalls(WALLS)
    q = np.array([-0.95, 1.95, 0.0, 0.0, 0.0, -0.9, 1.9])
    depth = walls.depth(q)
    assert depth is not None
    assert depth.tolist() == pytest.approx([0.05, -0.05, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert walls.depth(np.zeros(7)) is None
