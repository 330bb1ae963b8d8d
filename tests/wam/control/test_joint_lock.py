import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.clock import PERIOD_NS
from wam.control.joint_lock import RAMP, JointLock, LockGains

S = 1_000_000_000
START = 7 * S
FULL = START + S  # long after the stiffness has grown
GAINS = LockGains(kp=20.0, kd=0.2, limit=1.3, speed=0.3)


@pytest.fixture
def lock():
    lock = JointLock(GAINS)
    lock.engage(0.4, START)
    return lock


def test_the_lock_engages_without_a_torque_step(lock):
    assert lock.torque(0.4, 0.0, START) == 0.0
    assert lock.torque(0.45, 0.0, START) == 0.0  # no stiffness yet


def test_the_lock_pulls_back_to_its_engaged_position(lock):
    assert lock.torque(0.41, 0.0, FULL) == pytest.approx(-0.2, abs=1e-12)
    assert lock.torque(0.39, 0.0, FULL) == pytest.approx(+0.2, abs=1e-12)


@pytest.mark.parametrize("elapsed", [0.0, 0.25, 0.5, 1.0, 18.0])
def test_the_stiffness_is_ramped(lock, elapsed):
    tau = lock.torque(0.41, 0.0, START + int(elapsed * RAMP * S))
    assert tau == pytest.approx(-0.2 * min(elapsed, 1.0), abs=1e-12)


def test_the_damping_is_there_from_the_start(lock):
    assert lock.torque(0.4, 1.0, START) == pytest.approx(-0.2, abs=1e-12)
    assert lock.torque(0.4, -1.0, START) == pytest.approx(+0.2, abs=1e-12)


@pytest.mark.parametrize("share", [0.99, 1.01, 1000.0])
def test_the_torque_is_clipped_at_its_limit(lock, share):
    error, expected = share * GAINS.reach, min(share, 1.0) * GAINS.limit
    assert lock.torque(0.4 - error, 0.0, FULL) == pytest.approx(expected, abs=1e-9)
    assert lock.torque(0.4 + error, 0.0, FULL) == pytest.approx(-expected, abs=1e-9)


def test_the_torque_of_fast_motion_is_clipped(lock):
    assert lock.torque(0.4, 1e6, FULL) == -GAINS.limit


@given(
    q7=st.floats(-3, 3),
    qd7=st.floats(-50, 50),
    after_ns=st.integers(0, 10 * S),
)
def test_no_motion_makes_more_torque_than_the_limit(q7, qd7, after_ns):
    lock = JointLock(GAINS)
    lock.engage(0.4, START)
    assert abs(lock.torque(q7, qd7, START + after_ns)) <= GAINS.limit


def test_a_second_engage_keeps_the_first_reference(lock):
    lock.engage(1.0, FULL)
    assert lock.torque(0.41, 0.0, FULL) == pytest.approx(-0.2, abs=1e-12)
    assert lock.offset(0.41, FULL) == pytest.approx(0.01, abs=1e-12)


def test_a_released_lock_gives_no_torque(lock):
    lock.release(FULL)
    assert not lock.is_engaged
    assert lock.torque(2.0, 5.0, FULL + int(RAMP * S)) == 0.0
    assert lock.offset(2.0, FULL) == 0.0


def in_time(lock, q7, qd7, now_ns):
    """Return the torque of a lock whose last cycle was a period before."""
    lock.torque(q7, qd7, now_ns - PERIOD_NS)
    return lock.torque(q7, qd7, now_ns)


@pytest.mark.parametrize("elapsed", [0.0, 0.25, 0.8])
def test_a_released_lock_fades_over_its_ramp(lock, elapsed):
    before = in_time(lock, 0.41, 0.5, FULL)
    lock.release(FULL)
    tau = in_time(lock, 0.41, 0.5, FULL + int(elapsed * RAMP * S))
    assert tau == pytest.approx(before * (1.0 - elapsed), abs=1e-9)


@pytest.mark.parametrize("periods", [1, 2, 5, 25])
def test_a_slow_loop_gets_a_softer_lock_with_the_same_damping(lock, periods):
    usual = in_time(lock, 0.41, 0.0, FULL), in_time(lock, 0.4, 0.5, FULL + S)
    now_ns = FULL + 2 * S
    in_time(lock, 0.41, 0.0, now_ns)
    spring = lock.torque(0.41, 0.0, now_ns + periods * PERIOD_NS)
    damper = lock.torque(0.4, 0.5, now_ns + 2 * periods * PERIOD_NS)
    again = lock.torque(0.4, 0.5, now_ns + 2 * periods * PERIOD_NS)
    assert spring == pytest.approx(usual[0] / periods**2)
    assert damper == pytest.approx(usual[1] / periods)
    assert again == damper  # in the same cycle


def test_a_lock_released_while_it_grows_fades_from_there(lock):
    lock.release(START + S // 10)
    # A fifth of the stiffness was reached, which fades within a tenth of a second.
    at_release = lock.torque(0.41, 0.0, START + S // 10)
    assert at_release == pytest.approx(-0.04, abs=1e-9)
    assert lock.torque(0.41, 0.0, START + 2 * S // 10) == pytest.approx(0.0, abs=1e-9)


def test_a_second_release_does_not_restart_the_fade(lock):
    lock.release(FULL)
    lock.release(FULL + int(RAMP * S) // 2)
    assert lock.torque(0.41, 0.0, FULL + int(RAMP * S)) == 0.0


@pytest.mark.parametrize("goal", [1.0, -0.2])
def test_a_moved_reference_is_limited_in_speed(lock, goal):
    lock.move(goal, FULL)
    speed = GAINS.speed if goal > 0.4 else -GAINS.speed
    for after in (0.0, 0.5, 1.0):
        reference = lock.reference(FULL + int(after * S))
        assert reference == pytest.approx(0.4 + speed * after, abs=1e-9)
    assert lock.reference(FULL + 3 * S) == pytest.approx(goal, abs=1e-9)


def test_a_reference_moved_under_way_does_not_jump(lock):
    lock.move(1.0, FULL)
    lock.move(0.0, FULL + S)
    assert lock.reference(FULL + S) == pytest.approx(0.7, abs=1e-9)
    assert lock.reference(FULL + 2 * S) == pytest.approx(0.4, abs=1e-9)
    assert lock.offset(0.75, FULL + S) == pytest.approx(0.05, abs=1e-9)


def test_a_lock_that_is_not_engaged_cannot_be_moved(lock):
    lock.release(FULL)
    lock.move(1.0, FULL)
    assert lock.reference(FULL + S) == 0.4


@pytest.mark.parametrize("faded", [0.0, 0.1, 0.4])
def test_a_lock_re_engaged_while_fading_gives_no_torque_step(lock, faded):
    again = FULL + int(faded * S)
    lock.release(FULL)
    before = lock.torque(0.43, 0.0, again)
    assert before != 0.0
    lock.engage(0.43, again)
    assert lock.torque(0.43, 0.0, again) == pytest.approx(before, abs=1e-12)


def test_a_re_engaged_lock_holds_its_new_position_at_full_stiffness(lock):
    lock.release(FULL)
    lock.engage(0.43, FULL + S // 10)
    assert lock.is_engaged
    assert lock.torque(0.44, 0.0, FULL + S) == pytest.approx(-0.2, abs=1e-12)


def test_a_faded_lock_ramps_from_zero_at_its_new_position(lock):
    lock.release(FULL)
    lock.engage(1.0, FULL + S)
    assert lock.torque(1.1, 0.0, FULL + S) == 0.0
    assert lock.torque(1.01, 0.0, FULL + 2 * S) == pytest.approx(-0.2, abs=1e-12)


def test_a_new_lock_gives_no_torque():
    assert not JointLock().is_engaged
    assert JointLock().torque(1.0, 1.0, START) == 0.0


def test_the_given_gains_are_used():
    lock = JointLock(LockGains(kp=8.0, kd=0.05, limit=0.5))
    lock.engage(0.0, START)
    assert lock.torque(-0.01, 0.2, FULL) == pytest.approx(0.07, abs=1e-12)
    assert lock.torque(-1.0, 0.0, FULL) == 0.5


def test_the_lock_deflects_as_far_as_its_torque_limit_allows():
    assert LockGains(kp=8.0, limit=0.5).reach == 0.0625
    assert LockGains(kp=0.0).reach == float("inf")


def test_a_lock_without_a_spring_only_damps():
    lock = JointLock(LockGains(kp=0.0))
    lock.engage(0.4, START)
    lock.follow(2.0, FULL)
    assert lock.reference(FULL + S) == 0.4
    assert lock.torque(2.0, 1.0, FULL) == pytest.approx(-0.2)


@pytest.mark.parametrize(("q7", "reference"), [(-0.0625, 0.3), (-0.0627, -0.0002)])
def test_a_moving_reference_stops_at_the_largest_torque(q7, reference):
    lock = JointLock(LockGains(kp=8.0, limit=0.5))
    lock.engage(0.0, START)
    lock.move(1.0, FULL)
    lock.follow(q7, FULL)
    assert lock.reference(FULL + S) == pytest.approx(reference)


def test_the_lock_comes_to_rest_on_the_example_foot():
    """A push of 0.2 N m for 0.2 s, one cycle of delay, quantised to a count."""
    lock, inertia, count, dt = JointLock(), 1.0e-3 + 0.32e-3, 102.7e-6, 0.002
    lock.engage(0.0, START)
    q = qd = tau = 0.0
    seen, trace = 0.0, []
    for i in range(1500):
        before, seen = seen, count * round(q / count)
        wanted = lock.torque(seen, (seen - before) / dt, START + S + i * 2_000_000)
        push = 0.2 if 100 <= i < 200 else 0.0
        for _ in range(10):
            qd += (tau + push) / inertia * dt / 10
            q += qd * dt / 10
        tau = wanted
        trace.append(q)
    assert max(np.abs(trace)) < 0.02  # 0.2 N m at 20 N m/rad is 10 mrad
    assert max(np.abs(trace[-500:])) < 3 * count


def test_a_moving_reference_is_dragged_only_at_the_torque_limit(lock):
    lock.move(1.0, FULL)
    lock.follow(0.41, FULL + S // 10)  # 30 mrad on, 20 behind: it does not stop
    assert lock.reference(FULL + S) == pytest.approx(0.7, abs=1e-9)


def test_a_released_lock_does_not_drag_its_reference(lock):
    lock.release(FULL)
    lock.follow(2.0, FULL + S)
    assert lock.reference(FULL + 2 * S) == pytest.approx(0.4)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_reference_is_dragged_along_at_the_largest_torque(lock, side):
    lock.follow(0.4 + side, FULL)
    assert lock.torque(0.4 + side, 0.0, FULL) == pytest.approx(-side * 1.3)
    reference = lock.reference(FULL + S)
    assert reference == pytest.approx(0.4 + side * (1.0 - 1.3 / 20.0))


def test_a_new_lock_has_its_reference_at_zero():
    lock = JointLock()
    assert lock.reference(0) == lock.reference(START) == 0.0
    lock.engage(0.0, START)
    assert lock.torque(0.01, 0.0, START) == 0.0


def test_a_second_engage_does_not_move_the_reference(lock):
    lock.engage(1.0, FULL)
    for after in (1, 5):
        assert lock.reference(FULL + after * S) == pytest.approx(0.4)
    assert lock.torque(0.41, 0.0, FULL) == pytest.approx(-0.2, abs=1e-12)
