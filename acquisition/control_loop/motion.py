"""Motion of a driven arm against what was asked of it: energy, speed and travel.

An arm whose model, motors or encoders are not what they are taken for moves by itself:
it runs away in hold, or damping does not slow it down. No single limit of speed tells
that from a hand that pushes. The kinetic energy does, with how long the arm has been
asked to stand still and how far the sole has gone since. What a sound arm does in
sessions and calibrations stays below half of each limit.
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

_LAG_NS = 10_000_000  # of the filter of velocities
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Where an arm is taken for one that moves by itself.

    Attributes:
        activation_time: how long after the motors got power a person may still carry
            the arm [s].
        activation_energy: kinetic energy in that time [J].
        activation_speed: speed of the sole in that time [m/s].
        activation_travel: of the sole in that time [m].
        hold_settle: after which an arm that is to hold must have been slowed down [s].
        hold_energy: of an arm that holds, beyond what it came with until then [J].
        hold_speed: of its joints, after that [rad/s], seven.
        hold_travel: of its sole, however slowly it is dragged [m].
        damp_time: after which damping must have slowed the arm down [s].
        damp_share: of the energy at its begin that may be left then.
        damp_rest: energy that may be left in any case [J].
        damp_escape_time: after which no energy may be won [s].
        damp_escape: energy that may be won beyond the least one since [J].
        damp_escape_share: and of the energy at its begin.
        damp_travel: of the sole while damping [m].
        still_time: after which a damped sole must stand [s].
        still_speed: of a sole that stands [m/s].
        float_energy: of an arm that floats in a hand [J].
        guide_energy: of one that a hand guides, or that moves by itself [J].
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
    """What a driven arm does in one cycle.

    Attributes:
        now_ns: time of the cycle [ns].
        state: what is asked of the arm.
        is_moving: it moves or stands by itself, in hold.
        energy: kinetic energy [J].
        foot_speed: of the sole [m/s].
        sole: where it is [m].
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
    """How what is asked of a driven arm began.

    Attributes:
        powered_ns: since when its motors have had power [ns].
        since_ns: since when the same has been asked for [ns].
        state: that.
        is_moving: in hold, a move.
        sole: where it was then [m].
        energy: that it had then [J]; filtered velocities show it a little later.
        least: the least since [J].
    """

    powered_ns: int
    since_ns: int
    state: ArmState
    is_moving: bool
    sole: Point
    energy: float
    least: float


def follow(memory: MotionMemory | None, now: DrivenMotion) -> MotionMemory:
    """Return what is remembered after the cycle; None before = power comes now."""
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
        limits: where it is taken for one that moves by itself.
        memory: of `follow`, this cycle included.
        now: what it does.
        speed_limits: of the joints [rad/s], seven.
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
    """Idle an arm that starts off when its motors get power."""
    fault = Fault.ACTIVATION_MOTION
    if now.foot_speed > limits.activation_speed:
        return _speed(fault, now.foot_speed, limits.activation_speed)
    if now.energy > limits.activation_energy:
        return _energy(fault, now.energy, limits.activation_energy)
    return _travel(fault, dist(now.sole, memory.sole), limits.activation_travel)


def _check_held(
    limits: MotionLimits, memory: MotionMemory, now: DrivenMotion
) -> GuardVerdict:
    """Idle an arm that does not stay where it holds."""
    fault, most = Fault.HOLD_MOTION, limits.hold_energy
    seconds = (now.now_ns - memory.since_ns) / NS_PER_S
    is_settled = seconds >= limits.hold_settle or memory.since_ns == memory.powered_ns
    if not is_settled:
        most += memory.energy
    if now.energy > most:
        return _energy(fault, now.energy, most)
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
    """Idle an arm that its damping does not slow down."""
    fault, begun = Fault.DAMP_MOTION, memory.energy
    seconds = (now.now_ns - memory.since_ns) / NS_PER_S
    if seconds >= limits.still_time and now.foot_speed > limits.still_speed:
        return _speed(fault, now.foot_speed, limits.still_speed)
    if seconds >= limits.damp_time:
        most = limits.damp_share * begun + limits.damp_rest
        if now.energy > most:
            return _energy(fault, now.energy, most)
        joint = _first_beyond(now.qd, speed_limits)
        if joint is not None:
            return _joint_speed(fault, joint, now.qd, speed_limits)
    if seconds >= limits.damp_escape_time:
        most = memory.least + limits.damp_escape + limits.damp_escape_share * begun
        if now.energy > most:
            return _energy(fault, now.energy, most)
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


def _travel(fault: Fault, way: float, limit: float) -> GuardVerdict:
    if way <= limit:
        return OK
    return verdict_for(fault, MotionExcess("the sole's way", way, limit, "m"))
