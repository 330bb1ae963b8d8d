"""Settings of the arm's driver: transmission, limits and the timing of its cycle."""

from dataclasses import dataclass, field

from wam.driver.puck_properties import PuckTable, shipped_table
from wam.driver.safety_module import SafetyLimits
from wam.driver.transmission import HOST_TORQUE_LIMITS, Matrix
from wam.model.constants import load_constants

_MS = 1_000_000


def _shipped_j2mp() -> Matrix:
    return load_constants().j2mp


@dataclass(frozen=True, slots=True, eq=False)
class ArmSettings:
    """Settings of the driver: the arm and the cycle.

    Attributes:
        j2mp: motor angles from joint angles, shape (7, 7).
        torque_limits: largest torque the host sends to each motor [puck units].
        velocity_pole: corner of the velocity filter [rad/s].
        first_look_ns: from request to the first look at the bus [ns].
        give_up_ns: from request to the end of waiting for replies [ns].
        speed_limits: of the guard, for each joint [rad/s].
        jump_margin: a position is believed up to so many times the speed limits.
        unasked_every: in one of so many cycles no position is asked for; one that comes
            then answers an earlier question.
        safety_poll_cycles: cycles between questions for the safety mode, and between
            those for the pendant's word.
        health_poll_cycles: cycles between questions for the health of a puck.
        watch_poll_cycles: cycles between questions for what a puck said at the start.
        command_poll_cycles: cycles between questions for what a puck holds; 14 of them
            ask all seven for mode and torque.
        safety_limits: what the safety module is set to tolerate.
        pucks: what the motor pucks have to say of themselves.
        boot_ns: silence while pucks boot [ns].
        idle_ns: longest wait for the safety module to confirm IDLE [ns].
    """

    j2mp: Matrix = field(default_factory=_shipped_j2mp)
    torque_limits: tuple[int, ...] = HOST_TORQUE_LIMITS
    velocity_pole: float = 180.0
    first_look_ns: int = 700_000
    give_up_ns: int = 1_500_000
    speed_limits: tuple[float, ...] = (1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0)
    jump_margin: float = 2.0
    unasked_every: int = 47  # prime: never in step with the polls
    safety_poll_cycles: int = 25
    health_poll_cycles: int = 50
    watch_poll_cycles: int = 50
    command_poll_cycles: int = 4
    safety_limits: SafetyLimits = field(default_factory=SafetyLimits)
    pucks: PuckTable = field(default_factory=shipped_table)
    boot_ns: int = 1_000 * _MS
    idle_ns: int = 100 * _MS
