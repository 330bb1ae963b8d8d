"""A motor at rest that a move pulls beyond breakaway is reported as stuck."""

import numpy as np
import pytest

from acquisition.devices import ArmReading
from wam.control.position_control import BREAKAWAY, StallDetector
from wam.model.constants import load_constants

CONSTANTS = load_constants()
STEP = np.full(7, 0.004)  # progress of a move [rad]
REST = [1000, -2000, 3000, 0, 50, 60, 70]
J2MP = np.array(CONSTANTS.j2mp)
PROGRESS = np.array([1.0, 0.5, 0.5, 0.5, 2.0, 2.0, 3.0]) * 1e-3  # of a move [rad]


def reading(counts, fresh=0x7F):
    return ArmReading(
        host_ns=0,
        arm_ns=0,
        counts=list(counts),
        q=np.zeros(7),
        qd=np.zeros(7),
        qd7_raw=0.0,
        fresh=fresh,
        is_complete=True,
        missing_cycles=0,
    )


def turned(motor):
    """Return counts after all motors but one have turned."""
    counts = [count + 40 for count in REST]
    counts[motor - 1] = REST[motor - 1]
    return counts


def pull(share):
    """Return torques of all joints that give each motor its share of breakaway."""
    bounds = np.abs(np.linalg.inv(J2MP).T) @ BREAKAWAY
    return J2MP.T @ (share * bounds)


def look(counts, share=1.01, travel=STEP, fresh=0x7F):
    watch = StallDetector(CONSTANTS)
    assert watch.stuck_motor(np.zeros(7), pull(share), reading(REST)) == 0
    return watch.stuck_motor(travel, pull(share), reading(counts, fresh))


def moved_one(motor):
    """Return a travel of the joints that turns one motor only [rad], shape (7,)."""
    return np.linalg.solve(J2MP, 0.3 * np.eye(7)[motor - 1])


@pytest.mark.parametrize("motor", range(1, 8))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_motor_pulled_beyond_breakaway_and_at_rest_is_reported(motor, sign):
    assert look(turned(motor), 1.01 * sign, moved_one(motor)) == motor


@pytest.mark.parametrize("motor", range(1, 8))
def test_a_torque_below_breakaway_does_not_flag_a_motor(motor):
    assert look(turned(motor), 0.99, moved_one(motor)) == 0


@pytest.mark.parametrize("motor", range(1, 8))
def test_a_motor_not_needed_by_the_move_may_stand(motor):
    other = motor % 7 + 1
    assert look(turned(motor), travel=moved_one(other)) == 0


@pytest.mark.parametrize("motor", range(1, 8))
def test_a_motor_is_reported_only_after_the_move_has_progressed(motor):
    """Motors of a differential wait for the progress of both of its joints."""
    largest = (np.abs(J2MP) @ PROGRESS)[motor - 1]
    for share, named in ((0.99, 0), (1.01, motor)):
        angle = (-1) ** motor * share * largest * np.eye(7)[motor - 1]
        assert look(turned(motor), travel=np.linalg.solve(J2MP, angle)) == named


def test_an_intermittent_motor_is_judged_from_its_last_position():
    watch, moved = StallDetector(CONSTANTS), moved_one(1)
    largest = np.abs(J2MP)[0] @ PROGRESS / 0.3  # share of that travel
    counts = list(REST)
    for number in range(5):
        seen = reading([counts[0] + 2 * number, *turned(1)[1:]])
        assert watch.stuck_motor(0.9 * number * largest * moved, pull(2.0), seen) == 0
    assert watch.stuck_motor(4.6 * 0.9 * largest * moved, pull(2.0), seen) == 0
    assert watch.stuck_motor(5.2 * 0.9 * largest * moved, pull(2.0), seen) == 1


def test_one_count_of_flicker_is_not_motion_but_two_are():
    counts = turned(4)
    for flicker, stuck in ((-1, 4), (1, 4), (-2, 0), (2, 0)):
        assert look([*counts[:3], REST[3] + flicker, *counts[4:]]) == stuck


def test_a_silent_motor_is_not_reported_as_stuck():
    assert look(turned(4), fresh=0x77) == 0


def test_a_new_move_resets_the_watch():
    watch = StallDetector(CONSTANTS)
    watch.stuck_motor(np.zeros(7), pull(2.0), reading(REST))
    watch.begin()
    assert watch.stuck_motor(STEP, pull(2.0), reading(REST)) == 0
    assert watch.stuck_motor(2.0 * STEP, pull(2.0), reading(REST)) > 0


def test_the_breakaway_torque_is_moderately_above_dry_friction():
    assert (1.3 * CONSTANTS.coulomb < BREAKAWAY).all()
    assert (2.0 * CONSTANTS.coulomb + 5.0 > BREAKAWAY).all()
