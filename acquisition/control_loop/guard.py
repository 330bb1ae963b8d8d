"""The guard: limits and the state of the arm in, a verdict out. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import dist
from typing import NamedTuple

import numpy as np

from acquisition.bounds import are_between, are_within
from acquisition.clock import NS_PER_MS, NS_PER_S, PERIOD_NS
from acquisition.control_loop.contact import Contact, ContactState, check_contact
from acquisition.control_loop.details import (
    CircuitCauses,
    FootSpeedExcess,
    ForceAge,
    ForeignFrame,
    Joint7Slip,
    JointExcess,
    LateCycles,
    ReplySilence,
    SafetySilence,
    StillMotor,
    StuckMotor,
)
from acquisition.control_loop.faults import OK, Fault, GuardVerdict, verdict_for
from acquisition.control_loop.limits import GuardLimits
from acquisition.devices import ArmReading, SafetyMode, Vector

_BRAKED = frozenset({SafetyMode.E_STOP, SafetyMode.IDLE})
_NO_LOAD = ContactState()
_TREMBLE = 1  # counts by which an encoder at rest flickers

Point = tuple[float, float, float]


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
        may_drive: since torques are commanded the brakes were not confirmed once:
            from then on a braked arm is a stop, and no longer the state before
            activation.
        contact: what is remembered of the load on the foot.
        rests: in a trial, where each motor turned last.
    """

    armed: int = 0
    late: tuple[int, ...] = ()
    may_drive: bool = False
    contact: ContactState = _NO_LOAD
    rests: tuple[MotorRest, ...] = ()


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


def check(
    limits: GuardLimits, state: GuardState, seen: Observation
) -> tuple[GuardState, GuardVerdict]:
    """Return the next state and the most severe verdict of this cycle.

    Torques that are commanded are judged unless the brakes are confirmed since before:
    a safety circuit of unknown state may drive the arm. E-stop is always reported.

    Among equally severe ones: what takes the arm away (safety circuit, silence), then
    motion, then what only ends the trial (sensor, cadence).
    """
    now = seen.reading.host_ns
    state = _remember(limits, state, seen, now)
    is_stopped = seen.is_commanded and seen.safety is SafetyMode.E_STOP
    if not (state.may_drive or is_stopped):
        return state, OK
    contact, load = check_contact(
        limits,
        state.contact,
        now,
        seen.contact,
        is_recording=seen.is_recording,
        is_moving=seen.is_moving,
    )
    if contact is not state.contact:
        state = replace(state, contact=contact)
    # Plain numbers: seven of them are compared faster than numpy looks at an array.
    q, qd, tau = seen.reading.q.tolist(), seen.reading.qd.tolist(), seen.tau.tolist()
    verdicts = (
        _check_safety(limits, seen),
        _check_silence(limits, seen),
        _check_master(seen.reading.foreign_id),
        _check_move(seen.stuck_motor),
        _check_numbers(sum(q) + sum(qd) + sum(tau), seen),
        _check_position(limits, state, q),
        _check_speed(limits, seen, qd),
        _check_torque(limits, tau),
        _check_rests(limits, state, seen.sole),
        _check_trial(limits, seen),
        load,
        _check_cadence(limits, state, now),
    )
    if verdicts.count(OK) == len(verdicts):
        return state, OK
    return state, max((OK, *verdicts), key=lambda verdict: verdict.severity)


def _remember(
    limits: GuardLimits, state: GuardState, seen: Observation, now: int
) -> GuardState:
    armed = state.armed
    if armed != 0x7F and seen.reading.is_complete:
        q = seen.reading.q
        inside = (q > np.array(limits.q_lower) + limits.armed_inside) & (
            q < np.array(limits.q_upper) - limits.armed_inside
        )
        armed |= int(np.packbits(inside, bitorder="little")[0])
    late = state.late
    if seen.is_late or (late and late[0] < now - NS_PER_S):
        kept = tuple(t for t in late if t >= now - NS_PER_S)
        late = (*kept, now) if seen.is_late else kept
    may_drive = seen.is_commanded and (state.may_drive or seen.safety not in _BRAKED)
    rests = _rests(state.rests, seen) if seen.is_recording else ()
    is_same = armed == state.armed and late is state.late and rests is state.rests
    if is_same and may_drive is state.may_drive:
        return state
    return GuardState(armed, late, may_drive, state.contact, rests)


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


def _check_safety(limits: GuardLimits, seen: Observation) -> GuardVerdict:
    if seen.safety is SafetyMode.UNKNOWN:
        age_ms = seen.safety_age_ns / NS_PER_MS
        is_lasting = age_ms >= limits.idle_after_safety_ms
        detail = SafetySilence(age_ms)
        return verdict_for(Fault.SAFETY_SILENT, detail, is_lasting=is_lasting)
    if seen.safety not in _BRAKED:
        return OK
    fault = Fault.E_STOP if seen.safety is SafetyMode.E_STOP else Fault.PENDANT_IDLE
    return verdict_for(fault, CircuitCauses())


def _check_silence(limits: GuardLimits, seen: Observation) -> GuardVerdict:
    missing = seen.reading.missing_cycles
    if missing < limits.hold_after_missing:
        return OK
    is_lasting = missing >= limits.idle_after_missing
    jump = seen.reading.jump
    if jump is not None:
        return verdict_for(Fault.POSITION_JUMP, jump, is_lasting=is_lasting)
    silent = ~seen.reading.fresh & 0x7F  # bit i set = motor i+1 did not answer
    detail = ReplySilence(missing * PERIOD_NS / NS_PER_MS, silent)
    return verdict_for(Fault.CAN_SILENCE, detail, is_lasting=is_lasting)


def _check_master(foreign_id: int | None) -> GuardVerdict:
    """Give up an arm that takes torques of another program as well."""
    if foreign_id is None:
        return OK
    return verdict_for(Fault.BUS_SHARED, ForeignFrame(foreign_id))


def _check_move(stuck_motor: int) -> GuardVerdict:
    """Brake a move that turns a motor in vain: it would be pulled on for ever."""
    if not stuck_motor:
        return OK
    return verdict_for(Fault.MOTOR_STUCK, StuckMotor(stuck_motor))


def _check_rests(limits: GuardLimits, state: GuardState, sole: Point) -> GuardVerdict:
    """End a trial in which the sole goes on and a motor does not."""
    for i, rest in enumerate(state.rests):
        way, most = dist(rest.sole, sole), limits.still_ways[i]
        if way > most:
            detail = StillMotor(i + 1, 1e3 * way, 1e3 * most)
            return verdict_for(Fault.MOTOR_STILL, detail)
    return OK


def _check_numbers(total: float, seen: Observation) -> GuardVerdict:
    """Refuse what is no number; infinities that cancel in `total` leave NaN."""
    total += seen.foot_speed + seen.joint7_offset
    if total - total != 0.0:  # NaN or infinite
        return verdict_for(Fault.NOT_A_NUMBER)
    return OK


def _check_position(
    limits: GuardLimits, state: GuardState, q: list[float]
) -> GuardVerdict:
    lower, upper = limits.q_lower, limits.q_upper
    if not are_between(lower, q, upper):
        for i, (value, low, high) in enumerate(zip(q, lower, upper, strict=True)):
            if not low <= value <= high and state.armed >> i & 1:
                limit = low if value < low else high
                return verdict_for(Fault.JOINT_LIMIT, JointExcess(i + 1, value, limit))
    return OK


def _check_speed(
    limits: GuardLimits, seen: Observation, qd: list[float]
) -> GuardVerdict:
    excess = _first_excess(qd, limits.speed)
    if excess is not None:
        return verdict_for(Fault.OVERSPEED, excess)
    if seen.foot_speed > limits.foot_speed:
        detail = FootSpeedExcess(seen.foot_speed, limits.foot_speed)
        return verdict_for(Fault.FOOT_SPEED, detail)
    return OK


def _check_torque(limits: GuardLimits, tau: list[float]) -> GuardVerdict:
    excess = _first_excess(tau, limits.torque)
    return OK if excess is None else verdict_for(Fault.TORQUE_LIMIT, excess)


def _first_excess(values: list[float], limits: Sequence[float]) -> JointExcess | None:
    """Return the first joint beyond its limit; None if all are within."""
    if not are_within(values, limits):
        for i, (value, limit) in enumerate(zip(values, limits, strict=True)):
            if not -limit <= value <= limit:
                return JointExcess(i + 1, abs(value), limit)
    return None


def _check_trial(limits: GuardLimits, seen: Observation) -> GuardVerdict:
    if not seen.is_recording:
        return OK
    mrad = abs(seen.joint7_offset) * 1e3
    if mrad > limits.joint7_mrad:
        return verdict_for(Fault.JOINT7_SLIP, Joint7Slip(mrad, limits.joint7_mrad))
    age_ms = seen.ft_age_ns / NS_PER_MS
    if age_ms > limits.ft_stop_ms:
        return verdict_for(Fault.FT_STALE, ForceAge(age_ms, limits.ft_stop_ms))
    return OK


def _check_cadence(limits: GuardLimits, state: GuardState, now: int) -> GuardVerdict:
    late = len(state.late)
    if late > limits.late_per_second and state.late[-1] == now:
        return verdict_for(Fault.LOOP_LATE, LateCycles(late, limits.late_per_second))
    return OK
