"""Limits of the guard and of every torque command.

Every command passes `limit_torque` right before it is sent, in every state and after
every verdict: it limits torque and rate of change.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from operator import mul, sub

import numpy as np

from acquisition.bounds import are_within
from acquisition.control_loop.motion import MotionLimits
from acquisition.devices import Vector

_JOINTS = 7


_MOTION = MotionLimits()


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """Limits of the guard.

    Those set by `[limits]` of rig.toml have the same name and unit there, and no
    default here; the others follow from the arm and the protocol.

    Attributes:
        q_lower: lower joint limits [rad], seven.
        q_upper: upper joint limits [rad], seven.
        speed: joint speed limits [rad/s], seven.
        torque: joint torque limits [N m], seven.
        foot_speed: largest speed of the sole [m/s].
        joint7_mrad: largest displacement of the locked joint 7 [mrad].
        ft_stale_ms: age at which a force sample is flagged [ms].
        ft_stop_ms: age of the force sample that ends a trial [ms].
        ft_saturated_ms: longest saturation of the sensor in a trial [ms].
        contact_force: contact force that ends a trial [N].
        contact_force_hold: contact force that leads to hold [N].
        contact_moment: moment about the sensor's origin that ends a trial [N m].
        contact_moment_hold: moment about the sensor's origin that leads to hold [N m].
        contact_growth: growth of the force within 0.5 s at a resting foot that ends a
            trial [N].
        contact_force_move: force of an obstacle during a move that leads to hold [N]. A
            foot of 1 kg with a wrong sign of the sensor gives 20 N.
        late_per_second: late cycles in a second that lead to hold.
        still_travel: travel of the sole in a trial while a motor does not turn [m],
            seven. With stiction, joint 2 may move by one motor of its differential.
            With the friction of another arm, motors 2 to 6 rested for at most 35, 17,
            12, 21 and 33 mm in simulated trials; 1 and 7 may rest.
        hold_after_missing: consecutive incomplete cycles that lead to hold.
        idle_after_missing: consecutive incomplete cycles that lead to idle.
        idle_after_late: consecutive cycles without a request with stale positions that
            lead to idle; the first leads to hold.
        idle_after_safety_ms: age of the safety module's last report that leads to idle
            [ms]; requests are sent every 50 ms, so the mode is unknown after 250.
        idle_after_late_ms: time without a punctual cycle that leads to idle [ms]. A
            single stall is one late cycle and does not count.
        idle_after_gap_ms: duration of a stall of the loop that leads to idle [ms]. The
            safety module's watchdog idles the arm after 100 ms.
        armed_inside: a joint's position limit is armed once the joint was this far
            inside [rad]: the home position lies on two stops.
        motion: limits of the motion of a driven arm.
    """

    q_lower: Sequence[float]
    q_upper: Sequence[float]
    speed: Sequence[float]
    torque: Sequence[float]
    foot_speed: float
    joint7_mrad: float
    ft_stale_ms: float
    ft_stop_ms: float
    ft_saturated_ms: float
    contact_force: float
    contact_force_hold: float
    contact_moment: float
    contact_moment_hold: float
    contact_growth: float
    late_per_second: int
    contact_force_move: float = 40.0
    still_travel: Sequence[float] = (inf, 0.06, 0.06, 0.06, 0.06, 0.06, inf)
    hold_after_missing: int = 5
    idle_after_missing: int = 25
    idle_after_late: int = 3
    idle_after_safety_ms: float = 400.0
    idle_after_late_ms: float = 150.0
    idle_after_gap_ms: float = 200.0
    armed_inside: float = 0.1
    motion: MotionLimits = _MOTION

    def __post_init__(self) -> None:
        """Refuse a row that is too short: joints beyond its end would have no limit."""
        rows = (self.q_lower, self.q_upper, self.speed, self.torque, self.still_travel)
        if any(len(row) != _JOINTS for row in rows):
            lengths = ", ".join(str(len(row)) for row in rows)
            raise ValueError(f"limits of {_JOINTS} joints have {lengths} numbers")


# Slew-rate limit: largest change of a torque per cycle as a share of its limit; from
# zero to the limit takes 20 ms. In simulated sessions the largest change of a driven
# arm is 0.041 (1.8 N m at joint 2, when a trial begins to float), of the locked joint
# 7 0.018. The start of torques, a step of 26 N m at joint 2, takes 12 ms while idle,
# sooner than the pendant can activate the arm. Joint 7 is light and its lock stiff:
# at 0.1 the delayed lock accelerates the joint instead (17 rad/s after a twist of 1.2
# N m), at 0.3 it does not, and one false position causes 0.8 rad/s.
MAX_TORQUE_STEP = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.3)
_GENTLE_STEP = tuple(0.99 * step for step in MAX_TORQUE_STEP)  # margin for rounding


def limit_torque(tau: Vector, last: Vector, limits: Sequence[float]) -> Vector:
    """Clip the torques and their slew rate; return [N m], shape (7,). NaN passes.

    Args:
        tau: desired joint torques [N m], shape (7,).
        last: joint torques last sent [N m], shape (7,).
        limits: torque limits of the joints [N m], seven.
    """
    # Python floats: for seven values the loop is faster than numpy calls, and
    # comparisons cost half as much as `min` and `max`. Comparisons with NaN are False.
    values, previous = tau.tolist(), last.tolist()
    is_gentle = are_within(map(sub, values, previous), map(mul, _GENTLE_STEP, limits))
    if is_gentle and are_within(values, limits):
        return tau
    rows = zip(values, previous, limits, MAX_TORQUE_STEP, strict=True)
    bounded: list[float] = []
    for desired, before, limit, share in rows:
        step = share * limit
        low, high = before - step, before + step
        value = low if desired < low else high if desired > high else desired
        bounded.append(-limit if value < -limit else limit if value > limit else value)
    return np.array(bounded)
