import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wam.control.position_control import (
    PD_TORQUE_LIMIT,
    JointMove,
    joint_pd,
    move_reference,
)

ANGLES = st.lists(st.floats(-2.5, 2.5), min_size=7, max_size=7).map(np.array)


@given(ANGLES, ANGLES, st.floats(0.1, 2.0), st.floats(0.1, 5.0))
def test_a_move_starts_and_ends_at_rest_at_its_end_points(start, goal, speed, acc):
    move = JointMove(start, goal, speed, acc)
    for t, expected in ((0.0, start), (move.duration, goal), (1e6, goal)):
        q, qd = move.at(t)
        assert q == pytest.approx(expected, abs=1e-9)
        assert qd == pytest.approx(np.zeros(7), abs=1e-6)


@given(ANGLES, ANGLES, st.floats(0.0, 1.0))
def test_no_joint_is_faster_than_the_cap(start, goal, share):
    move = JointMove(start, goal)
    _, qd = move.at(share * move.duration)
    assert np.abs(qd).max() <= move.speed + 1e-9


@given(ANGLES, ANGLES, st.floats(0.01, 0.99))
def test_velocity_is_the_derivative_of_position(start, goal, share):
    move = JointMove(start, goal)
    h = 1e-6
    t = share * move.duration
    later, earlier = move.at(t + h)[0], move.at(t - h)[0]
    # at the corners of the trapezoid the difference straddles two slopes
    assert move.at(t)[1] == pytest.approx((later - earlier) / (2 * h), abs=1e-3)


@given(ANGLES, ANGLES, st.floats(0.0, 1.0))
def test_the_path_is_a_straight_line(start, goal, share):
    move = JointMove(start, goal)
    q = move.at(share * move.duration)[0]
    travel, whole = q - start, goal - start
    longest = int(np.abs(whole).argmax())
    if abs(whole[longest]) > 1e-6:
        expected = travel[longest] / whole[longest] * whole
        assert travel == pytest.approx(expected, abs=1e-9)


def test_the_duration_of_a_long_move_is_length_over_speed_plus_a_ramp():
    goal = np.zeros(7)
    goal[3] = 2.0
    assert JointMove(np.zeros(7), goal).duration == pytest.approx(2.0 / 0.5 + 1.0)


def test_the_pd_part_is_clipped_joint_by_joint():
    error = np.full(7, 1.0)
    tau = joint_pd(np.full(7, 1e4), np.zeros(7), error, np.zeros(7))
    assert tau == pytest.approx(PD_TORQUE_LIMIT)
    half = 0.5 * error
    assert joint_pd(np.full(7, 2.0), np.full(7, 3.0), half, error) == pytest.approx(
        np.full(7, 4.0)
    )


@pytest.mark.parametrize("length", [0.1, 0.49, 0.51, 2.0])
@given(share=st.floats(0.0, 1.0))
def test_a_move_decelerates_as_it_accelerates(length, share):
    """Half a radian is the shortest move that reaches the top speed."""
    goal = np.array([length, 0, 0, 0, 0, 0, 0])
    move = JointMove(np.zeros(7), goal)
    t = share * move.duration
    early, late = move.at(t), move.at(move.duration - t)
    assert early[0] + late[0] == pytest.approx(goal, abs=1e-9)
    assert early[1] == pytest.approx(late[1], abs=1e-9)


@pytest.mark.parametrize(("length", "top"), [(0.1, 0.05**0.5), (0.5, 0.5), (2.0, 0.5)])
def test_the_speed_at_midpoint_is_the_highest_the_length_allows(length, top):
    goal = np.array([0, 0, -length, 0, 0, 0, 0])
    move = JointMove(np.zeros(7), goal)
    q, qd = move.at(0.5 * move.duration)
    assert q[2] == pytest.approx(-0.5 * length)
    assert qd[2] == pytest.approx(-top)


def test_a_move_begins_with_its_acceleration():
    move = JointMove(np.zeros(7), np.full(7, 2.0), speed=0.4, acceleration=0.8)
    q, qd = move.at(0.25)
    assert (q[0], qd[0]) == pytest.approx((0.5 * 0.8 * 0.25**2, 0.2))
    assert move.at(0.5)[1][0] == pytest.approx(0.4)
    assert move.at(-1.0)[0].tolist() == [0.0] * 7


@pytest.mark.parametrize("offset", [-0.4, 0.4])
def test_joint_7_turns_at_its_top_speed_once_its_lock_has_released(offset):
    start, goal = np.full(7, 0.1), np.full(7, 0.1)
    goal[3], goal[6] = 1.1, 0.1 + offset
    move = JointMove(start, goal, 0.2)
    for t in (-1.0, 0.0, 0.5, 0.6, 1.0, 1.37, 1.5, move.duration, 99.0):
        q, qd = move_reference(move, t)
        straight, rates = move.at(t)
        # 0.5 rad/s after a twelfth of a second; 21 mrad of it are lost there.
        ahead = min(max(0.5 * (t - 0.5) - 0.5 / 24.0, 0.0), 0.4)
        assert q[6] == pytest.approx(0.1 + np.copysign(ahead, offset), abs=0.021)
        assert abs(qd[6]) <= 0.5
        assert q[:6].tolist() == straight[:6].tolist()
        assert qd[:6].tolist() == rates[:6].tolist()
    assert np.sign(move_reference(move, 1.0)[1][6]) == np.sign(offset)


@pytest.mark.parametrize("offset", [-0.4, 0.4])
def test_joint_7_reaches_its_top_speed_within_its_ramp(offset):
    goal = np.zeros(7)
    goal[6] = offset
    side = np.sign(offset)
    for after, turned, rate in (
        (-1 / 24, 0.0, 0.0),
        (1 / 24, 0.5 / 96, 0.25),
        (1 / 12, 0.5 / 24, 0.5),
        (0.4, 0.2 - 0.5 / 24, 0.5),
        (0.8 + 1 / 24, 0.4 - 0.5 / 96, 0.25),
        (0.8 + 1 / 12, 0.4, 0.0),
    ):
        q, qd = move_reference(JointMove(np.zeros(7), goal), 0.5 + after)
        assert (q[6], qd[6]) == pytest.approx((side * turned, side * rate))


def test_a_move_without_a_turn_of_joint_7_keeps_its_position():
    goal = np.zeros(7)
    goal[3] = 1.0
    assert move_reference(JointMove(np.zeros(7), goal), 0.7)[0][6] == 0.0
