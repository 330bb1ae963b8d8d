"""The guard: limits and the state of the arm in, a verdict out. Pure."""

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
    Joint7Slip,
    JointExcess,
    LateCycles,
    LateReplies,
    LoopGap,
    ReplySilence,
    SafetySilence,
    StillMotor,
    StuckMotor,
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
_ALL_JOINTS = 0x7F  # one bit each, bit i of joint or motor i+1
_TREMBLE = 1  # counts by which an encoder at rest flickers


class MotorRest(NamedTuple):
    """Where a motor stands [encoder counts], and the sole since it does [m]."""

    counts: int
    sole: Point


@dataclass(frozen=True, slots=True)
class GuardState:
    """What the guard remembers between cycles.

    Attributes:
        armed: bit i set = the position limit of joint i+1 counts.
        late: times of the late cycles of the last second [ns].
        late_since_ns: since when every cycle has been late [ns]; 0 = the last was not.
        may_drive: since torques are commanded idle was not confirmed once:
            from then on an idle arm is a stop, and no longer the state before
            activation.
        contact: what is remembered of the load on the foot.
        rests: in a trial, where each motor turned last.
        motion: how what is asked of a driven arm began; None = it is not driven.
    """

    armed: int = 0
    late: tuple[int, ...] = ()
    late_since_ns: int = 0
    may_drive: bool = False
    contact: ContactState = _NO_LOAD
    rests: tuple[MotorRest, ...] = ()
    motion: MotionMemory | None = None


class Observation(NamedTuple):
    """What the guard looks at in one cycle; a tuple, because it is made in each.

    Attributes:
        reading: joint positions and velocities.
        safety: state of the safety circuit, as last heard.
        safety_age_ns: age of its last answer [ns].
        foot_speed: speed of the sole [m/s].
        joint7_offset: displacement of joint 7 from where it was locked [rad].
        ft_age_ns: age of the force sample [ns].
        tau: joint torques about to be sent [N m], shape (7,).
        is_recording: a trial is being recorded.
        is_commanded: the state of the arm commands torques (not idle).
        is_late: this cycle began after its deadline.
        contact: the load on the foot; None = it is not known.
        stuck_motor: the motor that a move turns in vain, 1-7; 0 = none.
        sole: centre of the sole in the base frame [m].
        is_moving: the arm moves by itself, or keeps the goal of a move.
        state: what is asked of the arm.
        energy: its kinetic energy [J].
        is_starting: torques are ready for a person who activates the arm.
        skipped: cycles that did not run before this one.
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
    """All that a check may look at; not frozen, which would cost time in each cycle.

    Attributes:
        limits: where the guard steps in.
        state: what is remembered, this cycle included.
        seen: the observation of this cycle.
        load: the verdict on the load on the foot.
        motion: of an arm that is driven; None = it is not.
        q: joint positions [rad], seven plain numbers, which are compared faster than
            numpy looks at an array.
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

    Torques that are commanded are judged unless idle is confirmed since before: a
    safety circuit of unknown state may drive the arm. E-stop is always reported. An
    arm without torques must not be active nor recorded, and no other master may be
    there; one that is asked for torques must be active, or wait for its activation.
    Among equally severe verdicts the first of `CHECKS` counts.
    """
    may_drive = seen.is_commanded and (state.may_drive or seen.safety not in SHORTED)
    is_live = may_drive and seen.safety not in SHORTED
    motion = _driven(seen) if is_live else None
    state = _remember(limits, state, seen, motion, may_drive=may_drive)
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
    """Look at an arm that is idle, or is not active yet.

    Questions without torques keep the safety circuit content: once active, the arm
    would fall. Torques behind a circuit that nobody is asked to activate would drive it
    at the next press of the pendant.
    """
    if seen.reading.disobeys is not None:
        return verdict_for(Fault.PUCK_DISOBEYS, seen.reading.disobeys)
    if seen.state is ArmState.IDLE:
        if seen.reading.foreign_id is not None:
            return verdict_for(Fault.BUS_SHARED, ForeignFrame(seen.reading.foreign_id))
        if seen.reading.doubled:
            return verdict_for(Fault.PUCK_DOUBLED, DoubledPuck(seen.reading.doubled))
        if seen.safety is SafetyMode.ACTIVE:
            return verdict_for(Fault.NOT_ASKED_ACTIVE)
    if seen.is_recording or (seen.is_commanded and not seen.is_starting):
        return verdict_for(Fault.NOT_ACTIVE)
    return OK


def _remember(
    limits: GuardLimits,
    state: GuardState,
    seen: Observation,
    now: DrivenMotion | None,
    *,
    may_drive: bool,
) -> GuardState:
    """Return the next state but for the load; the same object if nothing changed."""
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
    """Return the joints whose position limit counts, as bits; none is taken back."""
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
    """Return where each motor turned last; a motor that is not heard is none."""
    counts, fresh = seen.reading.counts, seen.reading.fresh
    if not rests:
        return tuple(MotorRest(now, seen.sole) for now in counts)
    pairs = enumerate(zip(rests, counts, strict=True))
    turned = [
        i
        for i, (rest, now) in pairs
        if not -_TREMBLE <= now - rest.counts <= _TREMBLE or not fresh >> i & 1
    ]
    if not turned:
        return rests
    newer = list(rests)
    for i in turned:
        newer[i] = MotorRest(counts[i], seen.sole)
    return tuple(newer)


def _check_safety(facts: Facts) -> GuardVerdict:
    """Idle with the safety circuit; a silent one is given time to answer first."""
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
    """Hold, then idle, an arm whose positions are missing or cannot be true."""
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
    """Hold, then idle, an arm that tells where it was and not where it is."""
    late = facts.seen.reading.late
    if late is None:
        return OK
    is_lasting = late.in_a_row >= facts.limits.idle_after_late
    detail = LateReplies(late.age_ns / NS_PER_MS, late.motors)
    return verdict_for(Fault.REPLIES_LATE, detail, is_lasting=is_lasting)


def _check_master(facts: Facts) -> GuardVerdict:
    """Give up an arm that takes torques of another program as well."""
    foreign_id = facts.seen.reading.foreign_id
    if foreign_id is None:
        return OK
    return verdict_for(Fault.BUS_SHARED, ForeignFrame(foreign_id))


def _check_doubled(facts: Facts) -> GuardVerdict:
    """Give up an arm whose positions may be another sender's."""
    motor = facts.seen.reading.doubled
    return verdict_for(Fault.PUCK_DOUBLED, DoubledPuck(motor)) if motor else OK


def _check_change(facts: Facts) -> GuardVerdict:
    """Give up an arm whose torques or counts mean something else than at the start.

    Silence goes before: a controller that restarts answers as another one.
    """
    reading = facts.seen.reading
    if reading.change is None or reading.missing_cycles:
        return OK
    return verdict_for(Fault.PUCK_CHANGED, reading.change)


def _check_obedience(facts: Facts) -> GuardVerdict:
    """Give up an arm of which a motor does not do what it is told."""
    disobeys = facts.seen.reading.disobeys
    if disobeys is None:
        return OK
    return verdict_for(Fault.PUCK_DISOBEYS, disobeys)


def _check_move(facts: Facts) -> GuardVerdict:
    """Idle a move that turns a motor in vain: it would be pulled on for ever."""
    motor = facts.seen.stuck_motor
    if not motor:
        return OK
    return verdict_for(Fault.MOTOR_STUCK, StuckMotor(motor))


def _check_numbers(facts: Facts) -> GuardVerdict:
    """Refuse what is no number: no limit is exceeded by NaN, as no comparison holds."""
    seen = facts.seen
    # One sum shows them all: infinities of both signs leave NaN.
    total = sum(facts.q) + sum(facts.qd) + sum(facts.tau)
    if isfinite(total + seen.foot_speed + seen.joint7_offset):
        return OK
    return verdict_for(Fault.NOT_A_NUMBER)


def _check_position(facts: Facts) -> GuardVerdict:
    """Damp an arm of which a joint left its range after it had been well within."""
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
    """Damp an arm of which a joint or the sole is too fast."""
    limits, foot_speed = facts.limits, facts.seen.foot_speed
    excess = _first_excess(facts.qd, limits.speed)
    if excess is not None:
        return verdict_for(Fault.OVERSPEED, excess)
    if foot_speed > limits.foot_speed:
        detail = FootSpeedExcess(foot_speed, limits.foot_speed)
        return verdict_for(Fault.FOOT_SPEED, detail)
    return OK


def _check_torque(facts: Facts) -> GuardVerdict:
    """Damp an arm whose law asks for too much, before it is sent."""
    excess = _first_excess(facts.tau, facts.limits.torque)
    return OK if excess is None else verdict_for(Fault.TORQUE_LIMIT, excess)


def _check_motion(facts: Facts) -> GuardVerdict:
    """Idle an arm that does not do what it is asked for, by its energy and way."""
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
    """End a trial in which the sole goes on and a motor does not."""
    sole = facts.seen.sole
    for i, rest in enumerate(facts.state.rests):
        way, most = dist(rest.sole, sole), facts.limits.still_ways[i]
        if way > most:
            detail = StillMotor(i + 1, 1e3 * way, 1e3 * most)  # mm
            return verdict_for(Fault.MOTOR_STILL, detail)
    return OK


def _check_joint7(facts: Facts) -> GuardVerdict:
    """End a trial whose foot has turned against the lock of joint 7."""
    most = facts.limits.joint7_mrad
    mrad = abs(facts.seen.joint7_offset) * 1e3
    if facts.seen.is_recording and mrad > most:
        return verdict_for(Fault.JOINT7_SLIP, Joint7Slip(mrad, most))
    return OK


def _check_force_age(facts: Facts) -> GuardVerdict:
    """End a trial whose force is not measured any more."""
    most = facts.limits.ft_stop_ms
    age_ms = facts.seen.ft_age_ns / NS_PER_MS
    if facts.seen.is_recording and age_ms > most:
        return verdict_for(Fault.FT_STALE, ForceAge(age_ms, most))
    return OK


def _check_load(facts: Facts) -> GuardVerdict:
    """Stop for the load on the foot, which is judged in `contact`."""
    return facts.load


def _check_cadence(facts: Facts) -> GuardVerdict:
    """Hold when too many cycles of a second were late, this one among them.

    Where none has been in time for a while the arm is idled: it is driven by what it
    did long ago. Where none ran at all the module's heartbeat has idled it, and if it
    is active then somebody activated it that was not asked to.
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


# Of equally severe verdicts the first counts: what takes the arm away, then motion,
# then what only ends the trial.
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
