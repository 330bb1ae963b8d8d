from dataclasses import replace
from itertools import pairwise
from math import isinf
from typing import Any

import numpy as np
import pytest

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.faults import (
    OK,
    Action,
    Fault,
    ForceAge,
    FrozenEncoder,
    Joint7Slip,
    JointExcess,
    LateCycles,
    ReplySilence,
    SafetySilence,
    StalledMotor,
)
from acquisition.control_loop.guard import GuardState, Observation, check
from acquisition.control_loop.states import ArmState
from acquisition.devices import (
    ArmReading,
    LatePositions,
    MotorChange,
    PositionJump,
    SafetyMode,
)
from tests.acquisition.control_loop.limits import guard_limits

MS = 1_000_000
S = 1_000_000_000
ARMED = GuardState(armed=0x7F, may_drive=True)
LIMITS = guard_limits()


def reading(**changes):
    fields = {
        "host_ns": 10 * S,
        "arm_ns": 10 * S,
        "counts": [0] * 7,
        "q": np.zeros(7),
        "qd": np.zeros(7),
        "qd7_raw": 0.0,
        "fresh": 0x7F,
        "is_complete": True,
        "missing_cycles": 0,
    }
    return ArmReading(**(fields | changes))


OBSERVED = {
    "reading": reading(),
    "safety": SafetyMode.ACTIVE,
    "safety_age_ns": 0,
    "foot_speed": 0.0,
    "joint7_offset": 0.0,
    "ft_age_ns": 0,
    "tau": np.zeros(7),
    "is_recording": True,
    "is_commanded": True,
    "is_late": False,
    "stuck_motor": 0,
    "sole": (0.0, 0.0, 0.0),
    "is_moving": False,
    "state": ArmState.FLOAT,
    "energy": 0.0,
    "is_starting": False,
    "skipped": 0,
}
QUIET = Observation(**OBSERVED)


def seen(**changes):
    """Return a quiet cycle with `changes` to it or to its reading."""
    own = {k: v for k, v in changes.items() if k in OBSERVED}
    rest = {k: v for k, v in changes.items() if k not in own}
    return Observation(**(OBSERVED | {"reading": reading(**rest)} | own))


def judge(**changes: Any):
    return check(LIMITS, ARMED, seen(**changes))[1]


def at(joint, value, n=7):
    vector = np.zeros(n)
    vector[joint - 1] = value
    return vector


def missing(cycles):
    """Return changes to a reading; motor 6 has not answered for `cycles`."""
    return {"missing_cycles": cycles, "is_complete": False, "fresh": 0x5F}


def late(in_a_row):
    return {
        "late": LatePositions(0x40, 2_200_000, in_a_row),
        "is_without_request": True,
    }


CHANGE = MotorChange(3, "PIDX", 3, 2)
E = 1e-9
TO_HOLD, TO_IDLE = LIMITS.hold_after_missing, LIMITS.idle_after_missing
SILENT_NS = int(LIMITS.idle_after_safety_ms * MS)
STALE_NS = int(LIMITS.ft_stop_ms * MS)
SLIP = 1e-3 * LIMITS.joint7_mrad
ACTIVE, BRAKED, UNKNOWN = SafetyMode.ACTIVE, SafetyMode.IDLE, SafetyMode.UNKNOWN


def circuit(mode, age_ns=0):
    return {"safety": mode, "safety_age_ns": age_ns}


LIMIT_TABLE = [
    # fault, action, just inside the limit, just outside
    (Fault.BUS_SHARED, Action.IDLE, {"foreign_id": None}, {"foreign_id": 0x404}),
    (Fault.E_STOP, Action.IDLE, circuit(ACTIVE), circuit(SafetyMode.E_STOP)),
    (Fault.PENDANT_IDLE, Action.IDLE, circuit(ACTIVE), circuit(BRAKED)),
    (
        Fault.SAFETY_SILENT,
        Action.HOLD,
        circuit(ACTIVE, 2 * SILENT_NS),
        circuit(UNKNOWN, SILENT_NS - 1),
    ),
    (
        Fault.SAFETY_SILENT,
        Action.IDLE,
        circuit(ACTIVE, 2 * SILENT_NS),
        circuit(UNKNOWN, SILENT_NS),
    ),
    (Fault.CAN_SILENCE, Action.HOLD, missing(TO_HOLD - 1), missing(TO_HOLD)),
    (Fault.CAN_SILENCE, Action.HOLD, missing(0), missing(TO_IDLE - 1)),
    (Fault.CAN_SILENCE, Action.IDLE, missing(0), missing(TO_IDLE)),
    (Fault.REPLIES_LATE, Action.HOLD, {"late": None}, late(1)),
    (
        Fault.REPLIES_LATE,
        Action.HOLD,
        {"late": None},
        late(LIMITS.idle_after_late - 1),
    ),
    (Fault.REPLIES_LATE, Action.IDLE, {"late": None}, late(LIMITS.idle_after_late)),
    (Fault.PUCK_CHANGED, Action.IDLE, {"change": None}, {"change": CHANGE}),
    (Fault.PUCK_DOUBLED, Action.IDLE, {"doubled": 0}, {"doubled": 3}),
    (
        Fault.FOOT_SPEED,
        Action.DAMP,
        {"foot_speed": LIMITS.foot_speed},
        {"foot_speed": 1.01 * LIMITS.foot_speed},
    ),
    *(
        (
            Fault.JOINT7_SLIP,
            Action.HOLD,
            {"joint7_offset": sign * SLIP},
            {"joint7_offset": sign * 1.01 * SLIP},
        )
        for sign in (1, -1)
    ),
    (
        Fault.FT_STALE,
        Action.HOLD,
        {"ft_age_ns": STALE_NS},
        {"ft_age_ns": STALE_NS + 1},
    ),
]


@pytest.mark.parametrize(("fault", "action", "inside", "outside"), LIMIT_TABLE)
def test_every_limit_trips_just_outside_and_not_just_inside(
    fault, action, inside, outside
):
    assert judge(**inside).fault != fault
    verdict = judge(**outside)
    assert (verdict.fault, verdict.action) == (fault, action)


@pytest.mark.parametrize("joint", [1, 4, 7])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_joint_may_reach_but_not_pass_its_limit(joint, side):
    limit = float(getattr(LIMITS, f"q_{side}")[joint - 1])
    beyond = limit + (E if side == "upper" else -E)
    assert judge(q=at(joint, limit)).action is Action.NONE
    verdict = judge(q=at(joint, beyond))
    assert (verdict.fault, verdict.action) == (Fault.JOINT_LIMIT, Action.DAMP)
    assert verdict.detail == JointExcess(joint, beyond, limit)


@pytest.mark.parametrize(("joint", "sign"), [(1, 1), (4, -1), (7, 1)])
@pytest.mark.parametrize(
    ("field", "limits", "fault"),
    [("qd", LIMITS.speed, Fault.OVERSPEED), ("tau", LIMITS.torque, Fault.TORQUE_LIMIT)],
)
def test_a_joint_may_reach_but_not_exceed_its_speed_or_torque_limit(
    joint, sign, field, limits, fault
):
    limit = float(limits[joint - 1])
    assert judge(**{field: at(joint, sign * limit)}).action is Action.NONE
    verdict = judge(**{field: at(joint, sign * (limit + E))})
    assert (verdict.fault, verdict.action) == (fault, Action.DAMP)
    assert verdict.detail == JointExcess(joint, limit + E, limit)


def test_a_quiet_cycle_passes():
    state, verdict = check(LIMITS, ARMED, QUIET)
    assert verdict is OK
    assert replace(state, rests=(), motion=None) == ARMED


@pytest.mark.parametrize(
    ("field", "joint", "value"),
    [
        *(("q", 1, np.nan), ("qd", 7, np.nan), ("tau", 7, np.nan)),
        *(("q", 7, np.inf), ("qd", 1, np.inf), ("tau", 1, -np.inf)),
    ],
)
def test_a_quantity_that_is_not_a_number_ends_in_idle(field, joint, value):
    verdict = judge(**{field: at(joint, value)})
    assert (verdict.fault, verdict.action) == (Fault.NOT_A_NUMBER, Action.IDLE)


@pytest.mark.parametrize("field", ["foot_speed", "joint7_offset"])
def test_a_speed_or_offset_that_is_not_a_number_ends_in_idle(field):
    assert judge(**{field: float("nan")}).fault == Fault.NOT_A_NUMBER


def test_opposite_infinities_do_not_cancel():
    q = np.zeros(7)
    q[0], q[1] = np.inf, -np.inf
    assert judge(q=q).fault == Fault.NOT_A_NUMBER


FAULTS = {
    Fault.E_STOP: {"safety": SafetyMode.E_STOP},
    Fault.NOT_A_NUMBER: {"tau": at(1, np.nan)},
    Fault.JOINT_LIMIT: {"q": at(2, 2.5)},
    Fault.OVERSPEED: {"qd": at(3, 9.0)},
    Fault.FOOT_SPEED: {"foot_speed": 2.0},
    Fault.TORQUE_LIMIT: {"tau": at(4, 99.0)},
    Fault.CAN_SILENCE: missing(7),
    Fault.JOINT7_SLIP: {"joint7_offset": 0.2},
    Fault.FT_STALE: {"ft_age_ns": S},
}


@pytest.mark.parametrize(("worse", "milder"), list(pairwise(FAULTS)))
def test_the_more_severe_of_two_faults_is_reported(worse, milder):
    """Of equally severe ones, the first in the order of the checks."""
    assert judge(**(FAULTS[milder] | FAULTS[worse])).fault == worse


def test_no_fault_hides_a_more_severe_one():
    for changes in FAULTS.values():
        both = changes | {"safety": SafetyMode.E_STOP}
        assert judge(**both).action is Action.IDLE


@pytest.mark.parametrize("name", FAULTS)
def test_an_arm_without_commands_is_not_judged(name):
    idle = {"is_commanded": False, "is_recording": False}
    assert judge(**FAULTS[name], **idle).action is Action.NONE


@pytest.mark.parametrize("name", [Fault.JOINT7_SLIP, Fault.FT_STALE])
def test_trial_faults_need_a_trial(name):
    assert judge(**FAULTS[name], is_recording=False).action is Action.NONE


@pytest.mark.parametrize(
    "name", sorted(set(FAULTS) - {Fault.JOINT7_SLIP, Fault.FT_STALE})
)
def test_the_other_limits_apply_outside_a_trial_too(name):
    assert judge(**FAULTS[name], is_recording=False).fault == name


HOME = np.array([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0])


def test_home_on_the_stops_is_no_fault():
    state, verdict = check(LIMITS, GuardState(), seen(q=HOME))
    assert verdict.action is Action.NONE
    assert state.armed == 0b1110101  # joints 2 and 4 are at their stops


LOW, HIGH = (
    LIMITS.q_lower[1] + LIMITS.armed_inside,
    LIMITS.q_upper[1] - LIMITS.armed_inside,
)


@pytest.mark.parametrize(
    ("value", "is_armed"),
    [(LOW, False), (LOW + E, True), (HIGH - E, True), (HIGH, False)],
)
def test_a_position_limit_is_armed_inside_its_margin(value, is_armed):
    state, _ = check(LIMITS, GuardState(), seen(q=at(2, value)))
    assert bool(state.armed & 0b10) is is_armed


def test_an_armed_limit_stays_armed():
    state, _ = check(LIMITS, GuardState(), QUIET)
    assert state.armed == 0x7F
    state, verdict = check(LIMITS, state, seen(q=HOME))
    assert verdict.fault == Fault.JOINT_LIMIT
    assert state.armed == 0x7F


def test_limits_are_armed_while_the_arm_is_idle():
    state, _ = check(LIMITS, GuardState(), seen(is_commanded=False))
    assert state.armed == 0x7F


def test_an_extrapolated_position_arms_no_limit():
    state, _ = check(LIMITS, GuardState(), seen(**missing(1)))
    assert state.armed == 0


def test_only_joints_whose_limit_is_armed_are_judged():
    q = np.zeros(7)
    limit = LIMITS.q_upper[2]
    q[1], q[2] = 1.01 * LIMITS.q_lower[1], 1.01 * limit
    _, verdict = check(LIMITS, GuardState(armed=0b1111101), seen(q=q))
    assert verdict.detail == JointExcess(3, 1.01 * limit, limit)


def late_cycles(times, state=ARMED):
    """Return state and verdict after late cycles at `times`, punctual ones before."""
    verdict = OK
    for t_ns in times:
        state, _ = check(LIMITS, state, seen(host_ns=t_ns - 2 * MS))
        state, verdict = check(LIMITS, state, seen(is_late=True, host_ns=t_ns))
    return state, verdict


MOST = LIMITS.late_per_second
TOLERATED = [i * 10 * MS for i in range(MOST)]
TOO_MANY = [i * 10 * MS for i in range(MOST + 1)]


def test_late_cycles_up_to_the_limit_are_tolerated():
    assert late_cycles(TOLERATED)[1].action is Action.NONE


def test_late_cycles_beyond_the_limit_end_in_hold():
    _, verdict = late_cycles(TOO_MANY)
    assert (verdict.fault, verdict.action) == (Fault.LOOP_LATE, Action.HOLD)
    assert verdict.detail == LateCycles(MOST + 1, MOST)


def test_late_cycles_are_forgotten_after_the_window():
    assert late_cycles([*TOLERATED, S + 1])[1].action is Action.NONE
    assert late_cycles([*TOLERATED, S])[1].fault == Fault.LOOP_LATE


def test_a_late_cycle_counts_for_exactly_the_window():
    """The oldest late cycle is dropped; the next one is exactly one window old."""
    state, _ = late_cycles(TOO_MANY)
    state, _ = check(LIMITS, state, seen(host_ns=S - 2 * MS))
    at_end = seen(is_late=True, host_ns=S + 10 * MS)
    assert check(LIMITS, state, at_end)[1].detail == LateCycles(MOST + 1, MOST)
    beyond = seen(is_late=True, host_ns=S + 10 * MS + 1)
    assert check(LIMITS, state, beyond)[1] is OK


LATE_NS = int(LIMITS.idle_after_late_ms * MS)


@pytest.mark.parametrize(
    ("last_ns", "action"), [(LATE_NS - 1, Action.NONE), (LATE_NS, Action.IDLE)]
)
def test_an_arm_is_idled_after_a_long_run_of_late_cycles(last_ns, action):
    state = ARMED
    for t_ns in (S, S + LATE_NS // 2, S + last_ns):
        state, verdict = check(LIMITS, state, seen(is_late=True, host_ns=t_ns))
    assert verdict.action is action


def test_an_arm_whose_loop_stalled_is_idled():
    cycles = int(LIMITS.idle_after_gap_ms * MS) // PERIOD_NS
    assert judge(is_late=True, skipped=cycles - 1) is OK
    verdict = judge(is_late=True, skipped=cycles)
    assert (verdict.fault, verdict.action) == (Fault.LOOP_LOST, Action.IDLE)


def test_a_punctual_cycle_ends_a_run_of_late_ones():
    state = ARMED
    cycles = ((S, True), (S + LATE_NS - MS, False), (S + LATE_NS + MS, True))
    for t_ns, is_late in cycles:
        state, verdict = check(LIMITS, state, seen(is_late=is_late, host_ns=t_ns))
    assert verdict is OK


def test_a_punctual_cycle_does_not_repeat_the_verdict():
    state, _ = late_cycles(TOO_MANY)
    _, verdict = check(LIMITS, state, seen(host_ns=TOO_MANY[-1] + 2 * MS))
    assert verdict.action is Action.NONE


def test_the_memory_of_late_cycles_does_not_grow():
    state, _ = late_cycles(range(0, 60 * S, 500 * MS))
    assert len(state.late) <= 3
    state, _ = check(LIMITS, state, seen(host_ns=70 * S))
    assert state.late == ()


def test_a_cycle_without_new_data_keeps_the_state_object():
    state, _ = late_cycles([0])
    assert check(LIMITS, state, seen(host_ns=500 * MS))[0] is state


def led(steps, **changes):
    """Judge cycles of a trial; `steps` are (counts of motor 4, the sole's x [m])."""
    state, verdict = ARMED, OK
    for counts, x in steps:
        now = seen(counts=[0, 0, 0, counts, 0, 0, 0], sole=(x, 0.0, 0.0), **changes)
        state, verdict = check(ONE_MOTOR, state, now)
    return state, verdict


ONE_MOTOR = replace(LIMITS, still_travel=(9.0, 9.0, 9.0, 0.02, 9.0, 9.0, 9.0))


def test_a_stuck_motor_while_the_sole_moves_ends_the_session():
    _, verdict = led([(100, 0.3), (100, 0.3201)])
    assert (verdict.fault, verdict.action) == (Fault.ENCODER_FROZEN, Action.IDLE)
    assert verdict.detail == FrozenEncoder(4, pytest.approx(20.1), pytest.approx(20.0))
    assert verdict.ends_session


def test_the_sole_may_travel_up_to_the_limit():
    assert led([(100, 0.0), (100, 0.02)])[1] is OK
    assert led([(100, 0.0), (100, -0.02)])[1] is OK


def motor_at_rest(motor, travel):
    """Judge a trial in which all motors but `motor` turn and the sole goes `travel`."""
    state, verdict = ARMED, OK
    for counts, x in ((0, 0.0), (100, travel)):
        turned = [counts] * 7
        turned[motor - 1] = 0
        now = seen(counts=turned, sole=(0.0, x, 0.0))
        state, verdict = check(LIMITS, state, now)
    return verdict


@pytest.mark.parametrize("motor", [2, 6])
def test_a_motor_may_rest_up_to_its_limit_of_sole_travel(motor):
    limit = LIMITS.still_travel[motor - 1]
    assert motor_at_rest(motor, 0.99 * limit) is OK
    detail = motor_at_rest(motor, 1.01 * limit).detail
    assert detail == FrozenEncoder(
        motor, pytest.approx(1010.0 * limit), pytest.approx(1000.0 * limit)
    )


@pytest.mark.parametrize("counts", [99, 101])
def test_a_flicker_of_one_count_is_not_motion(counts):
    assert led([(100, 0.3), (counts, 0.31), (100, 0.3201)])[1].fault is not None


@pytest.mark.parametrize("counts", [98, 102])
def test_a_motor_that_turns_meanwhile_is_not_stuck(counts):
    steps = [(100, 0.3), (counts, 0.319), (counts, 0.3389)]
    assert led(steps)[1] is OK
    assert led([*steps, (counts, 0.3391)])[1].fault is Fault.ENCODER_FROZEN


def test_a_sole_at_rest_or_returning_flags_no_motor():
    assert led([(100, 0.3), (100, 0.3199), (100, 0.3), (100, 0.2801)])[1] is OK


def test_a_silent_motor_is_not_reported_as_stuck():
    quiet = {"fresh": 0x77, "is_complete": False, "missing_cycles": 1}
    assert led([(100, 0.3), (100, 0.33)], **quiet)[1] is OK


def test_no_motor_is_reported_as_stuck_between_trials():
    state, verdict = led([(100, 0.3), (100, 0.4)], is_recording=False)
    assert verdict is OK
    assert state.rests == ()


def test_a_motor_at_rest_keeps_the_state_object():
    state, _ = led([(100, 0.3)])
    again = seen(counts=[0, 0, 0, 100, 0, 0, 0], sole=(0.31, 0.0, 0.0))
    assert check(ONE_MOTOR, state, again)[0] is state


# Longest travel of the sole [m] while motors 2 to 6 of a sound arm stood still, in 40
# simulated trials at 0.4 to 1 of another arm's friction, without compensation.
STICKING = (0.0354, 0.017, 0.0123, 0.0213, 0.0325)


def test_a_motor_of_a_sound_arm_may_stick():
    margins = [
        limit / travel
        for limit, travel in zip(LIMITS.still_travel[1:6], STICKING, strict=True)
    ]
    assert min(margins) > 1.5


def test_only_motors_1_and_7_may_rest_for_a_whole_trial():
    without = [i for i, travel in enumerate(LIMITS.still_travel, 1) if isinf(travel)]
    assert without == [1, 7]
    assert motor_at_rest(1, 1e3) is OK
    assert motor_at_rest(7, 1e3) is OK


@pytest.mark.parametrize("motor", [1, 7])
def test_a_move_with_a_stuck_motor_is_braked(motor):
    verdict = judge(stuck_motor=motor, is_recording=False)
    assert (verdict.fault, verdict.action) == (Fault.MOTOR_STALLED, Action.IDLE)
    assert verdict.detail == StalledMotor(motor)
    assert verdict.ends_session


def test_silence_is_reported_with_duration_and_motors():
    silent_ms = TO_HOLD * PERIOD_NS / MS
    assert judge(**missing(TO_HOLD)).detail == ReplySilence(silent_ms, 0b0100000)


def test_details_are_in_the_units_of_the_message():
    stale = judge(ft_age_ns=26 * MS)
    assert stale.detail == ForceAge(26.0, LIMITS.ft_stop_ms)
    slipped = judge(joint7_offset=-0.061)
    assert isinstance(slipped.detail, Joint7Slip)
    assert slipped.detail.mrad == pytest.approx(61.0)
    assert slipped.detail.limit == LIMITS.joint7_mrad


def test_the_age_of_the_modules_last_reply_is_reported():
    verdict = judge(safety=SafetyMode.UNKNOWN, safety_age_ns=250 * MS)
    assert verdict.detail == SafetySilence(250.0)
    assert verdict.ends_session


@pytest.mark.parametrize("fault", [Fault.OVERSPEED, Fault.JOINT_LIMIT])
def test_motion_is_judged_while_the_safety_circuit_is_unknown(fault):
    changes = FAULTS[fault] | {"safety": SafetyMode.UNKNOWN}
    assert judge(**changes).fault == fault


def after(*modes, is_commanded=True, **last):
    """Return the verdict on the last of `modes`, from the first command on."""
    state, verdict = GuardState(), OK
    for mode in modes:
        changes = last if mode is modes[-1] else {}
        observed = seen(safety=mode, is_commanded=is_commanded, **changes)
        state, verdict = check(LIMITS, state, observed)
    return verdict


def test_torques_prepared_behind_confirmed_brakes_are_not_judged():
    ready = {"is_starting": True, "is_recording": False}
    assert after(BRAKED, BRAKED, qd=at(1, 9.0), **ready) is OK


@pytest.mark.parametrize(
    "asked", [{"is_recording": False}, {"is_starting": True}, {"is_commanded": False}]
)
def test_an_arm_behind_brakes_is_neither_driven_nor_recorded(asked):
    _, verdict = check(LIMITS, GuardState(), seen(safety=BRAKED, **asked))
    assert verdict.fault is Fault.NOT_ACTIVE


@pytest.mark.parametrize("before", [ACTIVE, UNKNOWN])
def test_brakes_after_a_driving_state_are_a_stop(before):
    assert after(BRAKED, before, BRAKED).fault is Fault.PENDANT_IDLE


def test_an_unknown_circuit_is_judged_from_the_first_command():
    assert after(UNKNOWN).fault is Fault.SAFETY_SILENT


def test_a_restart_behind_confirmed_brakes_is_not_a_stop():
    state = check(LIMITS, ARMED, seen(is_commanded=False))[0]
    starting = seen(safety=BRAKED, is_starting=True, is_recording=False)
    _, verdict = check(LIMITS, state, starting)
    assert verdict is OK


JUMP = PositionJump(motor=1, counts=990, speed=11.4)


@pytest.mark.parametrize(
    ("cycles", "action"),
    [
        *((TO_HOLD - 1, Action.NONE), (TO_HOLD, Action.HOLD)),
        *((TO_IDLE - 1, Action.HOLD), (TO_IDLE, Action.IDLE)),
    ],
)
def test_permanently_rejected_positions_are_a_separate_fault(cycles, action):
    verdict = judge(**missing(cycles), jump=JUMP)
    assert verdict.action is action
    if action is not Action.NONE:
        assert (verdict.fault, verdict.detail) == (Fault.POSITION_JUMP, JUMP)
        assert verdict.ends_session


@pytest.mark.parametrize(
    "name", ["q_lower", "q_upper", "speed", "torque", "still_travel"]
)
def test_limits_of_fewer_joints_than_the_arm_has_are_refused(name):
    with pytest.raises(ValueError, match="limits of 7 joints"):
        replace(LIMITS, **{name: getattr(LIMITS, name)[:6]})


IDLE = {"is_commanded": False, "is_recording": False, "state": ArmState.IDLE}


@pytest.mark.parametrize("before", [GuardState(), ARMED])
def test_an_arm_activated_without_a_request_is_idled(before):
    verdict = check(LIMITS, before, seen(safety=SafetyMode.ACTIVE, **IDLE))[1]
    assert (verdict.fault, verdict.action) == (Fault.UNREQUESTED_ACTIVE, Action.IDLE)


@pytest.mark.parametrize("safety", set(SafetyMode) - {SafetyMode.ACTIVE})
def test_an_inactive_idle_arm_is_no_fault(safety):
    assert judge(safety=safety, **IDLE) is OK


def test_an_unconfirmed_idle_is_not_repeated_in_every_cycle():
    unknown = {**IDLE, "state": ArmState.UNKNOWN}
    assert judge(safety=SafetyMode.ACTIVE, **unknown) is OK


def test_another_master_is_reported_before_the_arm_is_driven():
    verdict = judge(safety=SafetyMode.IDLE, foreign_id=0x404, **IDLE)
    assert verdict.fault is Fault.BUS_SHARED


def test_an_arm_that_runs_away_in_hold_is_idled():
    state = check(LIMITS, ARMED, seen(state=ArmState.HOLD))[0]
    later = seen(host_ns=11 * S, state=ArmState.HOLD, energy=0.5)
    verdict = check(LIMITS, state, later)[1]
    assert verdict.fault is Fault.HOLD_MOTION


def test_a_braked_arm_restarts_its_limits_at_activation():
    moved = {"sole": (1.0, 0.0, 0.0), "state": ArmState.HOLD, "is_recording": False}
    state = check(LIMITS, ARMED, seen(state=ArmState.HOLD))[0]
    state = check(LIMITS, state, seen(safety=SafetyMode.IDLE, **moved))[0]
    assert state.motion is None
    assert check(LIMITS, state, seen(host_ns=11 * S, **moved))[1] is OK
