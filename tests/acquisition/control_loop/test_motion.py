import pytest

from acquisition.control_loop.faults import OK, Action, Fault
from acquisition.control_loop.motion import (
    DrivenMotion,
    MotionLimits,
    check_motion,
    follow,
)
from acquisition.control_loop.states import ArmState

MS = 1_000_000
S = 1_000_000_000
START_NS = 10 * S  # no clock of a host begins when the arm gets power
LIMITS = MotionLimits()
SPEEDS = (1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0)
E = 1e-9
STILL = (0.0,) * 7


def motion(at_ms, state, **changes):
    fields = {
        "is_moving": False,
        "energy": 0.0,
        "foot_speed": 0.0,
        "sole": (0.0, 0.0, 0.0),
        "qd": STILL,
    }
    return DrivenMotion(START_NS + at_ms * MS, state, **(fields | changes))


def judge(*cycles):
    """Return the verdict on the last of `cycles`, all of one arm."""
    memory = None
    for now in cycles:
        memory = follow(memory, now)
    return check_motion(LIMITS, memory, cycles[-1], SPEEDS)


def fast(joint, speed):
    return tuple(speed if i == joint - 1 else 0.0 for i in range(7))


ACTIVATION = int(1e3 * LIMITS.activation_time)  # ms
LATER = ACTIVATION + 100  # ms
SETTLED = int(1e3 * LIMITS.hold_settle)
DAMPED, ESCAPE = int(1e3 * LIMITS.damp_time), int(1e3 * LIMITS.damp_escape_time)
STOPPED = int(1e3 * LIMITS.still_time)
HOLD, DAMP, FLOAT, GUIDE = (
    ArmState.HOLD,
    ArmState.DAMP,
    ArmState.FLOAT,
    ArmState.GUIDE,
)


def energy(value):
    return {"energy": value}


def foot(value):
    return {"foot_speed": value}


def along(axis):
    """Return a function of travel [m] that moves the sole along one axis."""
    return lambda value: {"sole": tuple(value * (i == axis) for i in range(3))}


def turn(joint):
    return lambda value: {"qd": fast(joint, value)}


TABLE = [
    # state, ms since power and state, what moves, limit, fault
    (HOLD, ACTIVATION - 1, foot, LIMITS.activation_speed, Fault.ACTIVATION_MOTION),
    (HOLD, ACTIVATION - 1, energy, LIMITS.activation_energy, Fault.ACTIVATION_MOTION),
    (HOLD, ACTIVATION - 1, along(1), LIMITS.activation_travel, Fault.ACTIVATION_MOTION),
    (HOLD, LATER, energy, LIMITS.hold_energy, Fault.HOLD_MOTION),
    (HOLD, LATER, along(2), -LIMITS.hold_travel, Fault.HOLD_MOTION),
    (HOLD, LATER, turn(4), -LIMITS.hold_speed[3], Fault.HOLD_MOTION),
    (DAMP, STOPPED, foot, LIMITS.still_speed, Fault.DAMP_MOTION),
    (DAMP, DAMPED, turn(6), SPEEDS[5], Fault.DAMP_MOTION),
    (DAMP, DAMPED, energy, LIMITS.damp_rest, Fault.DAMP_MOTION),
    (DAMP, ESCAPE + 4, energy, LIMITS.damp_escape, Fault.DAMP_MOTION),
    (DAMP, 2, along(0), LIMITS.damp_travel, Fault.DAMP_MOTION),
    (FLOAT, 9, energy, LIMITS.float_energy, Fault.KINETIC_ENERGY),
    (GUIDE, 9, energy, LIMITS.guide_energy, Fault.KINETIC_ENERGY),
]


@pytest.mark.parametrize(("state", "at", "moving", "limit", "fault"), TABLE)
def test_each_limit_of_motion_trips_beyond_its_value(state, at, moving, limit, fault):
    begin = motion(0, state)
    assert judge(begin, motion(at, state, **moving(limit))) is OK
    verdict = judge(begin, motion(at, state, **moving(1.01 * limit)))
    assert (verdict.fault, verdict.action) == (fault, Action.IDLE)
    assert verdict.detail.value == pytest.approx(1.01 * abs(limit))
    assert verdict.detail.limit == pytest.approx(abs(limit))
    assert verdict.ends_session


def test_quantities_without_a_limit_in_a_state_do_not_trip():
    settled = motion(LATER, HOLD, foot_speed=2.0 * LIMITS.activation_speed)
    assert judge(motion(0, HOLD), settled) is OK
    assert judge(motion(0, DAMP), motion(2, DAMP, energy=9.0)) is OK


def test_an_arm_may_enter_hold_with_its_energy():
    begin, speed = motion(0, FLOAT), 1.5 * LIMITS.hold_speed[5]
    come = motion(LATER, HOLD, energy=0.6, qd=fast(6, speed))
    assert judge(begin, come) is OK
    gained = 0.6 + 0.99 * LIMITS.hold_energy
    before, late = LATER + SETTLED - 1, LATER + SETTLED
    assert judge(begin, come, motion(before, HOLD, energy=gained)) is OK
    too_much = motion(late, HOLD, energy=1.01 * LIMITS.hold_energy)
    assert judge(begin, come, too_much).fault is Fault.HOLD_MOTION


def test_a_damped_arm_may_keep_part_of_its_energy():
    come = motion(LATER, DAMP, energy=1.0)
    begin = motion(0, FLOAT)
    rest = LIMITS.damp_share + LIMITS.damp_rest
    kept = motion(LATER + DAMPED, DAMP, energy=0.99 * rest)
    assert judge(begin, come, kept) is OK
    more = motion(LATER + DAMPED, DAMP, energy=1.01 * rest)
    assert judge(begin, come, more).fault is Fault.DAMP_MOTION


REGAINED = 0.2 + LIMITS.damp_escape + LIMITS.damp_escape_share  # of 1 J down to 0.2 J


def test_a_damped_arm_may_not_regain_energy():
    begin = motion(0, FLOAT)
    come = motion(LATER, DAMP, energy=1.0)
    least = motion(LATER + 20, DAMP, energy=0.2)
    again = motion(LATER + 40, DAMP, energy=1.01 * REGAINED)
    assert judge(begin, come, least, again).fault is Fault.DAMP_MOTION
    assert judge(begin, come, again) is OK


def test_a_move_is_limited_in_energy_but_not_in_hold_travel():
    begin = motion(0, HOLD)
    ahead = {"sole": (0.5, 0.0, 0.0), "energy": 0.5, "is_moving": True}
    assert judge(begin, motion(LATER, HOLD, **ahead)) is OK
    too_much = ahead | {"energy": 1.01 * LIMITS.guide_energy}
    verdict = judge(begin, motion(LATER, HOLD, **too_much))
    assert verdict.fault is Fault.KINETIC_ENERGY


def test_hold_measures_travel_from_its_start():
    begin = motion(0, FLOAT)
    hold = motion(LATER, HOLD, sole=(0.3, 0.0, 0.0))
    moved = (0.3 + 0.99 * LIMITS.hold_travel, 0.0, 0.0)
    assert judge(begin, hold, motion(LATER + 9, HOLD, sole=moved)) is OK


BEFORE = [
    # state, ms since power and state, motion that is not judged at that moment
    (HOLD, ACTIVATION, foot(1.01 * LIMITS.activation_speed)),
    (HOLD, ACTIVATION, energy(1.01 * LIMITS.activation_energy)),
    (HOLD, ACTIVATION, along(1)(1.01 * LIMITS.activation_travel)),
    (DAMP, STOPPED - 2, foot(1.01 * LIMITS.still_speed)),
    (DAMP, DAMPED - 2, turn(6)(1.01 * SPEEDS[5])),
    (DAMP, DAMPED - 2, energy(1.01 * LIMITS.damp_rest)),
]


@pytest.mark.parametrize(("state", "at", "seen"), BEFORE)
def test_each_limit_of_motion_applies_only_during_its_time(state, at, seen):
    """Limits of the activation have ended, those of damping have not begun."""
    assert judge(motion(0, state), motion(at, state, **seen)) is OK


def test_a_damped_arm_has_a_grace_period_for_energy():
    come = [motion(0, FLOAT), motion(LATER, DAMP, energy=1.0)]
    least = motion(LATER + 4, DAMP, energy=0.2)
    again = {"energy": 1.01 * REGAINED}
    assert judge(*come, least, motion(LATER + ESCAPE - 2, DAMP, **again)) is OK
    at = judge(*come, least, motion(LATER + ESCAPE, DAMP, **again))
    assert (at.fault, at.detail.limit) == (Fault.DAMP_MOTION, pytest.approx(REGAINED))
    kept = motion(LATER + ESCAPE, DAMP, energy=0.99 * REGAINED)
    assert judge(*come, least, kept) is OK


@pytest.mark.parametrize(("joint", "sense"), [(1, -1.0), (4, 1.0), (7, 1.0)])
def test_joints_at_rest_at_activation_are_judged_at_once(joint, sense):
    """An arm that enters hold in motion is given time to settle."""
    at_limit, beyond = (
        {"qd": fast(joint, sense * (LIMITS.hold_speed[joint - 1] + more))}
        for more in (0.0, E)
    )
    begin = motion(0, HOLD)
    assert judge(begin, motion(2, HOLD, **at_limit)) is OK
    assert judge(begin, motion(2, HOLD, **beyond)).fault is Fault.HOLD_MOTION
    come = [motion(0, FLOAT), motion(LATER, HOLD, **beyond)]
    assert judge(*come, motion(LATER + SETTLED - 2, HOLD, **beyond)) is OK
    late = judge(*come, motion(LATER + SETTLED, HOLD, **beyond))
    assert late.detail.quantity == f"the speed of joint {joint}"


def test_an_arm_entering_hold_may_gain_only_the_energy_limit():
    come = [motion(0, FLOAT), motion(LATER, HOLD, energy=0.6)]
    limit = 0.6 + LIMITS.hold_energy
    gained = motion(LATER + SETTLED - 2, HOLD, energy=1.01 * limit)
    verdict = judge(*come, gained)
    assert verdict.fault is Fault.HOLD_MOTION
    assert verdict.detail.limit == pytest.approx(limit)


def test_the_speed_limit_of_the_activation_ends_with_it():
    begin = motion(0, HOLD)
    again = motion(LATER, HOLD, **foot(1.01 * LIMITS.activation_speed))
    assert judge(begin, again) is OK


def test_energy_delayed_by_the_velocity_filter_counts_as_initial():
    before = motion(LATER, ArmState.HOLD)
    early = [before, motion(LATER + 2, ArmState.DAMP, energy=0.10)]
    late = motion(LATER + 100, ArmState.DAMP, energy=0.12)
    for at in (LATER + 10, LATER + 12):  # 8 and 10 ms after damping was requested
        assert judge(*early, motion(at, ArmState.DAMP, energy=0.30), late) is OK
    assert judge(*early, motion(LATER + 14, ArmState.DAMP, energy=0.30), late) is not OK
