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


LATER = 600  # ms: the activation is over
HOLD, DAMP, FLOAT, GUIDE = (
    ArmState.HOLD,
    ArmState.DAMP,
    ArmState.FLOAT,
    ArmState.GUIDE,
)
TABLE = [
    # state, ms since power and state, what just may be, what may not, fault
    (HOLD, 499, {"foot_speed": 0.45}, {"foot_speed": 0.451}, Fault.ACTIVATION_MOTION),
    (HOLD, 499, {"energy": 0.20}, {"energy": 0.20 + E}, Fault.ACTIVATION_MOTION),
    (
        HOLD,
        499,
        {"sole": (0.12, 0, 0)},
        {"sole": (0, 0.121, 0)},
        Fault.ACTIVATION_MOTION,
    ),
    (HOLD, LATER, {"energy": 0.35}, {"energy": 0.35 + E}, Fault.HOLD_MOTION),
    (HOLD, LATER, {"foot_speed": 0.9}, {"energy": 0.4}, Fault.HOLD_MOTION),
    (HOLD, LATER, {"sole": (0, 0, 0.2)}, {"sole": (0, 0, -0.201)}, Fault.HOLD_MOTION),
    (HOLD, LATER, {"qd": fast(4, -1.4)}, {"qd": fast(4, -1.41)}, Fault.HOLD_MOTION),
    (HOLD, LATER, {"qd": fast(7, 2.5)}, {"qd": fast(7, 2.51)}, Fault.HOLD_MOTION),
    (DAMP, 400, {"foot_speed": 0.03}, {"foot_speed": 0.031}, Fault.DAMP_MOTION),
    (DAMP, 60, {"qd": fast(6, 4.0)}, {"qd": fast(6, 4.01)}, Fault.DAMP_MOTION),
    (DAMP, 60, {"energy": 0.02}, {"energy": 0.02 + E}, Fault.DAMP_MOTION),
    (DAMP, 12, {"energy": 0.10}, {"energy": 0.10 + E}, Fault.DAMP_MOTION),
    (DAMP, 2, {"energy": 9.0}, {"sole": (0.101, 0, 0)}, Fault.DAMP_MOTION),
    (FLOAT, 9, {"energy": 0.9}, {"energy": 0.9 + E}, Fault.KINETIC_ENERGY),
    (GUIDE, 9, {"energy": 1.0}, {"energy": 1.0 + E}, Fault.KINETIC_ENERGY),
]


@pytest.mark.parametrize(("state", "at", "good", "bad", "fault"), TABLE)
def test_each_limit_of_motion_trips_at_its_value(state, at, good, bad, fault):
    begin = motion(0, state)
    assert judge(begin, motion(at, state, **good)) is OK
    verdict = judge(begin, motion(at, state, **bad))
    assert (verdict.fault, verdict.action) == (fault, Action.IDLE)
    assert verdict.detail.value > verdict.detail.limit
    assert verdict.ends_session


def test_an_arm_may_enter_hold_with_its_energy():
    come = motion(LATER, HOLD, energy=0.6, qd=fast(6, 3.0))
    begin = motion(0, FLOAT)
    assert judge(begin, come) is OK
    assert judge(begin, come, motion(LATER + 149, HOLD, energy=0.94)) is OK
    late = motion(LATER + 150, HOLD, energy=0.36)
    assert judge(begin, come, late).fault is Fault.HOLD_MOTION


def test_a_damped_arm_may_keep_part_of_its_energy():
    come = motion(LATER, DAMP, energy=1.0)
    begin = motion(0, FLOAT)
    half = motion(LATER + 60, DAMP, energy=0.51)
    assert judge(begin, come, half) is OK
    more = motion(LATER + 60, DAMP, energy=0.53)
    assert judge(begin, come, more).fault is Fault.DAMP_MOTION


def test_a_damped_arm_may_not_regain_energy():
    begin = motion(0, FLOAT)
    come = motion(LATER, DAMP, energy=1.0)
    least = motion(LATER + 20, DAMP, energy=0.2)
    again = motion(LATER + 40, DAMP, energy=0.46)
    assert judge(begin, come, least, again).fault is Fault.DAMP_MOTION
    assert judge(begin, come, again) is OK


def test_a_move_is_no_dragged_hold():
    begin = motion(0, HOLD)
    ahead = {"sole": (0.5, 0.0, 0.0), "energy": 0.5, "is_moving": True}
    assert judge(begin, motion(LATER, HOLD, **ahead)) is OK
    too_much = ahead | {"energy": 1.01}
    verdict = judge(begin, motion(LATER, HOLD, **too_much))
    assert verdict.fault is Fault.KINETIC_ENERGY


def test_hold_measures_travel_from_its_start():
    begin = motion(0, FLOAT)
    hold = motion(LATER, HOLD, sole=(0.3, 0.0, 0.0))
    assert judge(begin, hold, motion(LATER + 9, HOLD, sole=(0.45, 0.0, 0.0))) is OK


BEFORE = [
    # state, ms since power and state, what is judged from the next moment on
    (HOLD, 500, {"foot_speed": 0.46}),
    (HOLD, 500, {"energy": 0.21}),
    (HOLD, 500, {"sole": (0.0, 0.13, 0.0)}),
    (DAMP, 398, {"foot_speed": 0.031}),
    (DAMP, 58, {"qd": fast(6, 4.01)}),
    (DAMP, 58, {"energy": 0.03}),
]


@pytest.mark.parametrize(("state", "at", "seen"), BEFORE)
def test_each_limit_of_motion_has_its_time(state, at, seen):
    """The activation's ends, those of damping begin."""
    assert judge(motion(0, state), motion(at, state, **seen)) is OK


def test_a_damped_arm_has_a_grace_period_for_energy():
    come = [motion(0, FLOAT), motion(LATER, DAMP, energy=1.0)]
    least = motion(LATER + 4, DAMP, energy=0.2)
    again = {"energy": 0.46}
    assert judge(*come, least, motion(LATER + 6, DAMP, **again)) is OK
    at = judge(*come, least, motion(LATER + 8, DAMP, **again))
    assert (at.fault, at.detail.limit) == (Fault.DAMP_MOTION, pytest.approx(0.45))
    assert judge(*come, least, motion(LATER + 8, DAMP, energy=0.44)) is OK


@pytest.mark.parametrize("joint", range(1, 8))
@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_joints_at_rest_at_activation_are_judged_at_once(joint, way):
    """What comes into hold in motion is given 150 ms."""
    at_limit, beyond = (
        {"qd": fast(joint, way * (LIMITS.hold_speed[joint - 1] + more))}
        for more in (0.0, E)
    )
    begin = motion(0, HOLD)
    assert judge(begin, motion(2, HOLD, **at_limit)) is OK
    assert judge(begin, motion(2, HOLD, **beyond)).fault is Fault.HOLD_MOTION
    come = [motion(0, FLOAT), motion(LATER, HOLD, **beyond)]
    assert judge(*come, motion(LATER + 148, HOLD, **beyond)) is OK
    late = judge(*come, motion(LATER + 150, HOLD, **beyond))
    assert late.detail.quantity == f"the speed of joint {joint}"


def test_an_arm_entering_hold_may_gain_only_the_energy_limit():
    come = [motion(0, FLOAT), motion(LATER, HOLD, energy=0.6)]
    won = judge(*come, motion(LATER + 148, HOLD, energy=0.96))
    assert (won.fault, won.detail.limit) == (Fault.HOLD_MOTION, pytest.approx(0.95))


def test_an_old_activation_has_no_grace():
    begin = motion(0, HOLD)
    again = motion(LATER, HOLD, foot_speed=0.5)
    assert judge(begin, again) is OK


def test_held_joints_are_limited_to_the_documented_speeds():
    assert LIMITS.hold_speed == (1.2, 1.2, 1.2, 1.4, 2.0, 2.0, 2.5)


def test_energy_delayed_by_the_velocity_filter_counts_as_initial():
    before = motion(LATER, ArmState.HOLD)
    early = [before, motion(LATER + 2, ArmState.DAMP, energy=0.10)]
    late = motion(LATER + 100, ArmState.DAMP, energy=0.12)
    for at in (LATER + 10, LATER + 12):  # 8 and 10 ms after damping was asked for
        assert judge(*early, motion(at, ArmState.DAMP, energy=0.30), late) is OK
    assert judge(*early, motion(LATER + 14, ArmState.DAMP, energy=0.30), late) is not OK
