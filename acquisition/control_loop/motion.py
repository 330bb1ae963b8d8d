"""Runaway detection: energy, speed and travel of a driven arm in each state.

With a wrong model, motor or encoder an arm moves by itself: it runs away in hold, or
damping does not slow it down. A speed limit alone cannot tell that from a person who
pushes. Kinetic energy can, together with the time in the state and the travel of the
sole since. In sessions and calibrations a sound arm stays below half of each limit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import dist
from typing import NamedTuple

from acquisition.bounds import are_within
from acquisition.clock import NS_PER_S
from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.faults import OK, Fault, GuardVerdict, verdict_for
from acquisition.control_loop.states import ArmState

_LAG_NS = 10_000_000  # lag of the velocity filter
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the motion of a driven arm.

    Attributes:
        activation_time: time after power-on in which a person may still support the
            arm [s].
        activation_energy: kinetic energy in that time [J].
        activation_speed: speed of the sole in that time [m/s].
        activation_travel: travel of the sole in that time [m].
        hold_settle: time in which hold must have stopped the arm [s].
        hold_energy: kinetic energy in hold; until then plus the initial one [J].
        hold_speed: joint speeds in hold after that time [rad/s], seven.
        hold_travel: travel of the sole in hold, at any speed [m].
        damp_time: time in which damping must have slowed the arm [s].
        damp_share: share of the initial energy that may remain then.
        damp_rest: energy that may remain in any case [J].
        damp_escape_time: time after which the energy must not grow [s].
        damp_escape: allowed growth beyond the minimum so far [J].
        damp_escape_share: additional growth as a share of the initial energy.
        damp_travel: travel of the sole while damping [m].
        still_time: time after which a damped sole must be at rest [s].
        still_speed: speed of a sole at rest [m/s].
        float_energy: kinetic energy in float [J].
        guide_energy: kinetic energy in guide or in a move [J].
    """

    activation_time: float = 0.5
    activation_energy: float = 0.20
    activation_speed: float = 0.45
    activation_travel: float = 0.12
    hold_settle: float = 0.15
    hold_energy: float = 0.35
    hold_speed: Sequence[float] = (1.2, 1.2, 1.2, 1.4, 2.0, 2.0, 2.5)
    hold_travel: float = 0.20
    damp_time: float = 0.06
    damp_share: float = 0.5
    damp_rest: float = 0.02
    damp_escape_time: float = 0.008
    damp_escape: float = 0.10
    damp_escape_share: float = 0.15
    damp_travel: float = 0.10
    still_time: float = 0.4
    still_speed: float = 0.03
    float_energy: float = 0.9
    guide_energy: float = 1.0


class DrivenMotion(NamedTuple):
    """Motion of a driven arm in one cycle.

    Attributes:
        now_ns: time of the cycle [ns].
        state: state of the arm.
        is_moving: in hold, a move is under travel or its goal kept.
        energy: kinetic energy [J].
        foot_speed: speed of the sole [m/s].
        sole: position of the sole [m].
        qd: joint velocities [rad/s], seven.
    """

    now_ns: int
    state: ArmState
    is_moving: bool
    energy: float
    foot_speed: float
    sole: Point
    qd: Sequence[float]


class MotionMemory(NamedTuple):
    """Start of the present state of a driven arm.

    Attributes:
        powered_ns: time of power-on [ns].
        since_ns: start of the state [ns].
        state: state of the arm.
        is_moving: in hold, a move.
        sole: position of the sole at the start [m].
        energy: kinetic energy at the start, maximum over the filter's lag [J].
        least: smallest energy since [J].
    """

    powered_ns: int
    since_ns: int
    state: ArmState
    is_moving: bool
    sole: Point
    energy: float
    least: float


def follow(memory: MotionMemory | None, now: DrivenMotion) -> MotionMemory:
    """Return the memory after this cycle; None before means power-on now."""
    if (
        memory is None
        or now.state is not memory.state
        or now.is_moving is not memory.is_moving
    ):
        powered_ns = now.now_ns if memory is None else memory.powered_ns
        return MotionMemory(
            powered_ns,
            now.now_ns,
            now.state,
            now.is_moving,
            now.sole,
            now.energy,
            now.energy,
        )
    if now.energy > memory.energy and now.now_ns - memory.since_ns <= _LAG_NS:
        return memory._replace(energy=now.energy, least=now.energy)
    if now.energy < memory.least:
        return memory._replace(least=now.energy)
    return memory


def check_motion(
    limits: MotionLimits,
    memory: MotionMemory,
    now: DrivenMotion,
    speed_limits: Sequence[float],
) -> GuardVerdict:
    """Return the verdict on the motion of a driven arm.

    Args:
        limits: limits of the motion.
        memory: result of `follow` including this cycle.
        now: motion in this cycle.
        speed_limits: joint speed limits [rad/s], seven.
    """
    state = now.state
    if state is ArmState.FLOAT:
        return _energy(Fault.KINETIC_ENERGY, now.energy, limits.float_energy)
    if now.is_moving or state is ArmState.GUIDE:
        return _energy(Fault.KINETIC_ENERGY, now.energy, limits.guide_energy)
    if state is ArmState.DAMP:
        return _check_damped(limits, memory, now, speed_limits)
    if now.now_ns - memory.powered_ns < limits.activation_time * NS_PER_S:
        verdict = _check_activated(limits, memory, now)
        if verdict is not OK:
            return verdict
    return _check_held(limits, memory, now)


def _check_activated(
    limits: MotionLimits, memory: MotionMemory, now: DrivenMotion
) -> GuardVerdict:
    """Idle if the arm starts to move at power-on."""
    fault = Fault.ACTIVATION_MOTION
    if now.foot_speed > limits.activation_speed:
        return _speed(fault, now.foot_speed, limits.activation_speed)
    if now.energy > limits.activation_energy:
        return _energy(fault, now.energy, limits.activation_energy)
    return _travel(fault, dist(now.sole, memory.sole), limits.activation_travel)


def _check_held(
    limits: MotionLimits, memory: MotionMemory, now: DrivenMotion
) -> GuardVerdict:
    """Idle if the arm does not stay in place in hold."""
    fault, limit = Fault.HOLD_MOTION, limits.hold_energy
    seconds = (now.now_ns - memory.since_ns) / NS_PER_S
    is_settled = seconds >= limits.hold_settle or memory.since_ns == memory.powered_ns
    if not is_settled:
        limit += memory.energy
    if now.energy > limit:
        return _energy(fault, now.energy, limit)
    joint = _first_beyond(now.qd, limits.hold_speed) if is_settled else None
    if joint is not None:
        return _joint_speed(fault, joint, now.qd, limits.hold_speed)
    return _travel(fault, dist(now.sole, memory.sole), limits.hold_travel)


def _check_damped(
    limits: MotionLimits,
    memory: MotionMemory,
    now: DrivenMotion,
    speed_limits: Sequence[float],
) -> GuardVerdict:
    """Idle if damping does not slow the arm down."""
    fault, initial = Fault.DAMP_MOTION, memory.energy
    seconds = (now.now_ns - memory.since_ns) / NS_PER_S
    if seconds >= limits.still_time and now.foot_speed > limits.still_speed:
        return _speed(fault, now.foot_speed, limits.still_speed)
    if seconds >= limits.damp_time:
        limit = limits.damp_share * initial + limits.damp_rest
        if now.energy > limit:
            return _energy(fault, now.energy, limit)
        joint = _first_beyond(now.qd, speed_limits)
        if joint is not None:
            return _joint_speed(fault, joint, now.qd, speed_limits)
    if seconds >= limits.damp_escape_time:
        limit = memory.least + limits.damp_escape + limits.damp_escape_share * initial
        if now.energy > limit:
            return _energy(fault, now.energy, limit)
    return _travel(fault, dist(now.sole, memory.sole), limits.damp_travel)


def _first_beyond(values: Sequence[float], limits: Sequence[float]) -> int | None:
    if are_within(values, limits):
        return None
    for i, (value, limit) in enumerate(zip(values, limits, strict=True)):
        if not -limit <= value <= limit:
            return i
    return None


def _energy(fault: Fault, value: float, limit: float) -> GuardVerdict:
    if value <= limit:
        return OK
    return verdict_for(fault, MotionExcess("kinetic energy", value, limit, "J"))


def _speed(fault: Fault, value: float, limit: float) -> GuardVerdict:
    return verdict_for(fault, MotionExcess("the sole's speed", value, limit, "m/s"))


def _joint_speed(
    fault: Fault, joint: int, qd: Sequence[float], limits: Sequence[float]
) -> GuardVerdict:
    quantity = f"the speed of joint {joint + 1}"
    detail = MotionExcess(quantity, abs(qd[joint]), limits[joint], "rad/s")
    return verdict_for(fault, detail)


def _travel(fault: Fault, travel: float, limit: float) -> GuardVerdict:
    if travel <= limit:
        return OK
    return verdict_for(fault, MotionExcess("the sole's travel", travel, limit, "m"))
