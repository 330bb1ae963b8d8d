"""Settings of the arm's driver: transmission, limits and cycle timing."""

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
    """Settings of the driver.

    Attributes:
        j2mp: motor angles from joint angles, shape (7, 7).
        torque_limits: largest torque the host sends to each motor [puck units].
        velocity_pole: corner frequency of the velocity filter [rad/s].
        first_read_ns: delay from the request to the first read of the bus [ns].
        give_up_ns: delay from the request to the end of waiting for replies [ns].
        speed_limits: joint speed limits of the guard [rad/s].
        jump_margin: positions are accepted up to this multiple of the speed limits.
        request_free_every: period of cycles without a position request [cycles]; a
            reply in such a cycle answers an earlier request.
        safety_poll_cycles: period of requests for the safety mode, and for PEN.
        health_poll_cycles: period of requests for puck telemetry.
        watch_poll_cycles: period of requests for properties read at the start.
        command_poll_cycles: period of read-backs of commands; 14 of them cover mode and
            torque of all seven pucks.
        safety_limits: limits of the safety module.
        pucks: expected properties of the motor pucks.
        boot_ns: time without traffic while pucks boot [ns].
        idle_ns: longest wait for the safety module to confirm IDLE [ns].
    """

    j2mp: Matrix = field(default_factory=_shipped_j2mp)
    torque_limits: tuple[int, ...] = HOST_TORQUE_LIMITS
    velocity_pole: float = 180.0
    first_read_ns: int = 700_000
    give_up_ns: int = 1_500_000
    speed_limits: tuple[float, ...] = (1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0)
    jump_margin: float = 2.0
    request_free_every: int = 47  # prime: never in step with the polls
    safety_poll_cycles: int = 25
    health_poll_cycles: int = 50
    watch_poll_cycles: int = 50
    command_poll_cycles: int = 4
    safety_limits: SafetyLimits = field(default_factory=SafetyLimits)
    pucks: PuckTable = field(default_factory=shipped_table)
    boot_ns: int = 1_000 * _MS
    idle_ns: int = 100 * _MS
