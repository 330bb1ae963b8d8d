"""Guard of the arm: pure functions from limits and observations to a verdict."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import dist, isfinite
from typing import NamedTuple

import numpy as np

from acquisition.bounds import are_between, are_within
from acquisition.clock import NS_PER_MS, NS_PER_S, PERIOD_NS
from acquisition.control_loop.contact import Contact, ContactState, check_contact
from acquisition.control_loop.details import (
    CircuitCauses,
    DoubledPuck,
    FootSpeedExcess,
    ForceAge,
    ForeignFrame,
    FrozenEncoder,
    Joint7Slip,
    JointExcess,
    LateCycles,
    LateReplies,
    LoopGap,
    ReplySilence,
    SafetySilence,
    StalledMotor,
)
from acquisition.control_loop.faults import OK, Fault, GuardVerdict, verdict_for
from acquisition.control_loop.limits import GuardLimits
from acquisition.control_loop.motion import (
    DrivenMotion,
    MotionMemory,
    Point,
    check_motion,
    follow,
)
from acquisition.control_loop.states import ArmState
from acquisition.devices import SHORTED, ArmReading, SafetyMode, Vector

_NO_LOAD = ContactState()
_ALL_JOINTS = 0x7F  # bit i = joint or motor i+1
_FLICKER = 1  # counts of encoder flicker at rest


class MotorRest(NamedTuple):
    """Position of a motor at rest [encoder counts], and of the sole at its stop [m]."""

    counts: int
    sole: Point


@dataclass(frozen=True, slots=True)
class GuardState:
    """State of the guard between cycles.

    Attributes:
        armed: bit i set = the position limit of joint i+1 is armed.
        late: times of the late cycles of the last second [ns].
        late_since_ns: start of an unbroken series of late cycles [ns]; 0 = none.
        may_drive: the safety circuit was seen not idle since torques are commanded:
            from then on idle is a stop, not the state before activation.
        contact: state of the contact checks.
        rests: in a trial, last change of each motor's position.
        motion: start of the present state of a driven arm; None = not driven.
    """

    armed: int = 0
    late: tuple[int, ...] = ()
    late_since_ns: int = 0
    may_drive: bool = False
    contact: ContactState = _NO_LOAD
    rests: tuple[MotorRest, ...] = ()
    motion: MotionMemory | None = None


class Observation(NamedTuple):
    """Inputs of the guard in one cycle; a tuple for speed.

    Attributes:
        reading: joint positions and velocities.
        safety: last reported state of the safety circuit.
        safety_age_ns: age of that report [ns].
        foot_speed: speed of the sole [m/s].
        joint7_offset: displacement of joint 7 from its locked position [rad].
        ft_age_ns: age of the force sample [ns].
        tau: joint torques about to be sent [N m], shape (7,).
        is_recording: a trial is being recorded.
        is_commanded: the state of the arm commands torques (not idle).
        is_late: this cycle began after its deadline.
        contact: contact load; None = not known.
        stuck_motor: motor that a move drives without moving it, 1-7; 0 = none.
        sole: centre of the sole in the base frame [m].
        is_moving: the arm makes a move or keeps its goal.
        state: state of the arm.
        energy: kinetic energy [J].
        is_starting: torques are sent for an arm about to be activated.
        skipped: number of skipped cycles before this one.
    """

    reading: ArmReading
    safety: SafetyMode
    safety_age_ns: int
    foot_speed: float
    joint7_offset: float
    ft_age_ns: int
    tau: Vector
    is_recording: bool
    is_commanded: bool
    is_late: bool
    contact: Contact | None = None
    stuck_motor: int = 0
    sole: Point = (0.0, 0.0, 0.0)
    is_moving: bool = False
    state: ArmState = ArmState.FLOAT
    energy: float = 0.0
    is_starting: bool = False
    skipped: int = 0


@dataclass(slots=True)
class Facts:
    """Inputs of a check; not frozen, for speed.

    Attributes:
        limits: limits of the guard.
        state: state of the guard including this cycle.
        seen: observation of this cycle.
        load: verdict on the contact load.
        motion: motion of a driven arm; None = not driven.
        q: joint positions [rad], seven Python floats, faster to compare than an array.
        qd: joint velocities [rad/s], seven.
        tau: joint torques about to be sent [N m], seven.
    """

    limits: GuardLimits
    state: GuardState
    seen: Observation
    load: GuardVerdict
    motion: DrivenMotion | None
    q: list[float]
    qd: list[float]
    tau: list[float]


def check(
    limits: GuardLimits, state: GuardState, seen: Observation
) -> tuple[GuardState, GuardVerdict]:
    """Return the next state and the most severe verdict of this cycle.

    All checks run while torques are commanded, unless the circuit has been idle since
    they began: a circuit of unknown state may drive the arm. E-stop is always reported.
    Without torques the arm must be neither active nor recorded, and the bus without
    another master; with torques it must be active or about to be activated. Among
    equally severe verdicts the first of `CHECKS` counts.
    """
    may_drive = seen.is_commanded and (state.may_drive or seen.safety not in SHORTED)
    is_live = may_drive and seen.safety not in SHORTED
    motion = _driven(seen) if is_live else None
    state = _next_state(limits, state, seen, motion, may_drive=may_drive)
    is_stopped = seen.is_commanded and seen.safety is SafetyMode.E_STOP
    if not (may_drive or is_stopped):
        return state, _check_idle(seen)
    contact, load = check_contact(
        limits,
        state.contact,
        seen.reading.host_ns,
        seen.contact,
        is_recording=seen.is_recording,
        is_moving=seen.is_moving,
    )
    if contact is not state.contact:
        state = replace(state, contact=contact)
    q, qd, tau = seen.reading.q.tolist(), seen.reading.qd.tolist(), seen.tau.tolist()
    facts = Facts(limits, state, seen, load, motion, q, qd, tau)
    worst = OK
    for check_one in CHECKS:
        verdict = check_one(facts)
        if verdict is not OK and verdict.severity > worst.severity:
            worst = verdict
    return state, worst


def _check_idle(seen: Observation) -> GuardVerdict:
    """Check an arm that is idle or not yet active.

    Replies to position requests suffice to feed the heartbeat monitor: an arm activated
    without torques would drop. Torques commanded without a requested activation would
    drive the arm when the pendant is next pressed.
    """
    if seen.reading.disobeys is not None:
        return verdict_for(Fault.PUCK_DISOBEYS, seen.reading.disobeys)
    if seen.state is ArmState.IDLE:
        if seen.reading.foreign_id is not None:
            return verdict_for(Fault.BUS_SHARED, ForeignFrame(seen.reading.foreign_id))
        if seen.reading.doubled:
            return verdict_for(Fault.PUCK_DOUBLED, DoubledPuck(seen.reading.doubled))
        if seen.safety is SafetyMode.ACTIVE:
            return verdict_for(Fault.UNREQUESTED_ACTIVE)
    if seen.is_recording or (seen.is_commanded and not seen.is_starting):
        return verdict_for(Fault.NOT_ACTIVE)
    return OK


def _next_state(
    limits: GuardLimits,
    state: GuardState,
    seen: Observation,
    now: DrivenMotion | None,
    *,
    may_drive: bool,
) -> GuardState:
    """Return the next state except `contact`; the same object if nothing changed."""
    armed = _armed(limits, state.armed, seen.reading)
    late = _late_cycles(state.late, seen)
    since_ns = (state.late_since_ns or seen.reading.host_ns) if seen.is_late else 0
    rests = _rests(state.rests, seen) if seen.is_recording else ()
    motion = None if now is None else follow(state.motion, now)
    is_same = armed == state.armed and late is state.late and rests is state.rests
    is_same = is_same and since_ns == state.late_since_ns
    if is_same and may_drive is state.may_drive and motion is state.motion:
        return state
    return GuardState(armed, late, since_ns, may_drive, state.contact, rests, motion)


def _driven(seen: Observation) -> DrivenMotion:
    return DrivenMotion(
        seen.reading.host_ns,
        seen.state,
        seen.is_moving,
        seen.energy,
        seen.foot_speed,
        seen.sole,
        seen.reading.qd.tolist(),
    )


def _armed(limits: GuardLimits, armed: int, reading: ArmReading) -> int:
    """Return the bits of the joints with armed position limits; never disarms."""
    if armed == _ALL_JOINTS or not reading.is_complete:
        return armed
    is_inside = (reading.q > np.array(limits.q_lower) + limits.armed_inside) & (
        reading.q < np.array(limits.q_upper) - limits.armed_inside
    )
    return armed | int(np.packbits(is_inside, bitorder="little")[0])


def _late_cycles(late: tuple[int, ...], seen: Observation) -> tuple[int, ...]:
    """Return the times of the late cycles of the last second [ns]."""
    now = seen.reading.host_ns
    since = now - NS_PER_S
    if late and late[0] < since:
        late = tuple(t for t in late if t >= since)
    return (*late, now) if seen.is_late else late


def _rests(rests: tuple[MotorRest, ...], seen: Observation) -> tuple[MotorRest, ...]:
    """Return the last move of each motor; a silent motor counts as moving."""
    counts, fresh = seen.reading.counts, seen.reading.fresh
    if not rests:
        return tuple(MotorRest(now, seen.sole) for now in counts)
    pairs = enumerate(zip(rests, counts, strict=True))
    moved = [
        i
        for i, (rest, now) in pairs
        if not -_FLICKER <= now - rest.counts <= _FLICKER or not fresh >> i & 1
    ]
    if not moved:
        return rests
    updated = list(rests)
    for i in moved:
        updated[i] = MotorRest(counts[i], seen.sole)
    return tuple(updated)


def _check_safety(facts: Facts) -> GuardVerdict:
    """Idle on an E-stop or an idle circuit; allow a silent circuit some time."""
    seen = facts.seen
    if seen.safety is SafetyMode.UNKNOWN:
        age_ms = seen.safety_age_ns / NS_PER_MS
        is_lasting = age_ms >= facts.limits.idle_after_safety_ms
        detail = SafetySilence(age_ms)
        return verdict_for(Fault.SAFETY_SILENT, detail, is_lasting=is_lasting)
    if seen.safety not in SHORTED:
        return OK
    fault = Fault.E_STOP if seen.safety is SafetyMode.E_STOP else Fault.PENDANT_IDLE
    return verdict_for(fault, CircuitCauses())


def _check_silence(facts: Facts) -> GuardVerdict:
    """Hold, then idle, if positions are missing or implausible."""
    limits, reading = facts.limits, facts.seen.reading
    missing = reading.missing_cycles
    if missing < limits.hold_after_missing:
        return OK
    is_lasting = missing >= limits.idle_after_missing
    if reading.jump is not None:
        return verdict_for(Fault.POSITION_JUMP, reading.jump, is_lasting=is_lasting)
    silent = ~reading.fresh & _ALL_JOINTS  # bit i set = motor i+1 did not answer
    detail = ReplySilence(missing * PERIOD_NS / NS_PER_MS, silent)
    return verdict_for(Fault.CAN_SILENCE, detail, is_lasting=is_lasting)


def _check_late(facts: Facts) -> GuardVerdict:
    """Hold, then idle, if positions are stale."""
    late = facts.seen.reading.late
    if late is None:
        return OK
    is_lasting = late.in_a_row >= facts.limits.idle_after_late
    detail = LateReplies(late.age_ns / NS_PER_MS, late.motors)
    return verdict_for(Fault.REPLIES_LATE, detail, is_lasting=is_lasting)


def _check_master(facts: Facts) -> GuardVerdict:
    """Idle if another bus master is present, which may send torques, too."""
    foreign_id = facts.seen.reading.foreign_id
    if foreign_id is None:
        return OK
    return verdict_for(Fault.BUS_SHARED, ForeignFrame(foreign_id))


def _check_doubled(facts: Facts) -> GuardVerdict:
    """Idle if positions may come from another sender."""
    motor = facts.seen.reading.doubled
    return verdict_for(Fault.PUCK_DOUBLED, DoubledPuck(motor)) if motor else OK


def _check_change(facts: Facts) -> GuardVerdict:
    """Idle if the units of torques or counts have changed since the start.

    Missing replies take precedence: a restarting puck reports other values.
    """
    reading = facts.seen.reading
    if reading.change is None or reading.missing_cycles:
        return OK
    return verdict_for(Fault.PUCK_CHANGED, reading.change)


def _check_obedience(facts: Facts) -> GuardVerdict:
    """Idle if a motor does not execute its command."""
    disobeys = facts.seen.reading.disobeys
    if disobeys is None:
        return OK
    return verdict_for(Fault.PUCK_DISOBEYS, disobeys)


def _check_move(facts: Facts) -> GuardVerdict:
    """Idle if a move drives a motor that does not move: its torque would stay."""
    motor = facts.seen.stuck_motor
    if not motor:
        return OK
    return verdict_for(Fault.MOTOR_STALLED, StalledMotor(motor))


def _check_numbers(facts: Facts) -> GuardVerdict:
    """Idle on NaN or infinity: comparisons with NaN never exceed a limit."""
    seen = facts.seen
    # One sum detects all: infinities of opposite sign give NaN.
    total = sum(facts.q) + sum(facts.qd) + sum(facts.tau)
    if isfinite(total + seen.foot_speed + seen.joint7_offset):
        return OK
    return verdict_for(Fault.NOT_A_NUMBER)


def _check_position(facts: Facts) -> GuardVerdict:
    """Damp if a joint leaves its range after having been well inside."""
    lower, upper = facts.limits.q_lower, facts.limits.q_upper
    if are_between(lower, facts.q, upper):
        return OK
    rows = zip(facts.q, lower, upper, strict=True)
    for i, (value, low, high) in enumerate(rows):
        is_armed = facts.state.armed >> i & 1
        if is_armed and not low <= value <= high:
            limit = low if value < low else high
            return verdict_for(Fault.JOINT_LIMIT, JointExcess(i + 1, value, limit))
    return OK


def _check_speed(facts: Facts) -> GuardVerdict:
    """Damp if a joint or the sole is too fast."""
    limits, foot_speed = facts.limits, facts.seen.foot_speed
    excess = _first_excess(facts.qd, limits.speed)
    if excess is not None:
        return verdict_for(Fault.OVERSPEED, excess)
    if foot_speed > limits.foot_speed:
        detail = FootSpeedExcess(foot_speed, limits.foot_speed)
        return verdict_for(Fault.FOOT_SPEED, detail)
    return OK


def _check_torque(facts: Facts) -> GuardVerdict:
    """Damp if the control law demands too much torque, before it is sent."""
    excess = _first_excess(facts.tau, facts.limits.torque)
    return OK if excess is None else verdict_for(Fault.TORQUE_LIMIT, excess)


def _check_motion(facts: Facts) -> GuardVerdict:
    """Idle if energy or travel does not fit the state of the arm."""
    now, memory, limits = facts.motion, facts.state.motion, facts.limits
    if now is None or memory is None:
        return OK
    return check_motion(limits.motion, memory, now, limits.speed)


def _first_excess(values: list[float], limits: Sequence[float]) -> JointExcess | None:
    """Return the first joint beyond its limit; None if all are within."""
    if are_within(values, limits):
        return None
    for i, (value, limit) in enumerate(zip(values, limits, strict=True)):
        if not -limit <= value <= limit:
            return JointExcess(i + 1, abs(value), limit)
    return None


def _check_rests(facts: Facts) -> GuardVerdict:
    """Idle in a trial if the sole moves while a motor does not turn."""
    sole = facts.seen.sole
    for i, rest in enumerate(facts.state.rests):
        travel, limit = dist(rest.sole, sole), facts.limits.still_travel[i]
        if travel > limit:
            detail = FrozenEncoder(i + 1, 1e3 * travel, 1e3 * limit)  # mm
            return verdict_for(Fault.ENCODER_FROZEN, detail)
    return OK


def _check_joint7(facts: Facts) -> GuardVerdict:
    """Hold if the foot turns against the lock of joint 7 in a trial."""
    limit = facts.limits.joint7_mrad
    mrad = abs(facts.seen.joint7_offset) * 1e3
    if facts.seen.is_recording and mrad > limit:
        return verdict_for(Fault.JOINT7_SLIP, Joint7Slip(mrad, limit))
    return OK


def _check_force_age(facts: Facts) -> GuardVerdict:
    """Hold if the force is stale in a trial."""
    limit = facts.limits.ft_stop_ms
    age_ms = facts.seen.ft_age_ns / NS_PER_MS
    if facts.seen.is_recording and age_ms > limit:
        return verdict_for(Fault.FT_STALE, ForceAge(age_ms, limit))
    return OK


def _check_load(facts: Facts) -> GuardVerdict:
    """Return the verdict on the contact load, from `contact`."""
    return facts.load


def _check_cadence(facts: Facts) -> GuardVerdict:
    """Hold if too many cycles within a second were late, including this one.

    Idle if no cycle has been punctual for a while: the torques are based on old
    positions. Also idle after a gap: the heartbeat has idled the arm meanwhile, and an
    active arm was activated without a request.
    """
    state, limits, now_ns = facts.state, facts.limits, facts.seen.reading.host_ns
    since_ns, late = state.late_since_ns, state.late
    late_ms = (now_ns - since_ns) / NS_PER_MS if since_ns else 0.0
    gap_ms = facts.seen.skipped * PERIOD_NS / NS_PER_MS
    if gap_ms >= limits.idle_after_gap_ms:
        return verdict_for(Fault.LOOP_LOST, LoopGap(gap_ms, limits.idle_after_gap_ms))
    if late_ms >= limits.idle_after_late_ms:
        return verdict_for(Fault.LOOP_LOST, LoopGap(late_ms, limits.idle_after_late_ms))
    if len(late) > limits.late_per_second and late[-1] == now_ns:
        return verdict_for(
            Fault.LOOP_LATE, LateCycles(len(late), limits.late_per_second)
        )
    return OK


# Of equally severe verdicts the first counts: first loss of the arm, then motion, then
# causes that only end the trial.
CHECKS: tuple[Callable[[Facts], GuardVerdict], ...] = (
    _check_safety,
    _check_silence,
    _check_late,
    _check_master,
    _check_doubled,
    _check_change,
    _check_obedience,
    _check_move,
    _check_numbers,
    _check_position,
    _check_speed,
    _check_torque,
    _check_motion,
    _check_rests,
    _check_joint7,
    _check_force_age,
    _check_load,
    _check_cadence,
)
