"""Limits: where the guard steps in, and what no command exceeds.

Every command passes `bounded_torque` right before it is sent, whatever state or verdict
it is of: torques within their limits, and no sudden ones.
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
    """Where the guard steps in.

    What `[limits]` of rig.toml sets has the same name and unit there, and no default
    here; the rest follows from the arm and from the protocol.

    Attributes:
        q_lower: lower joint limits [rad], seven.
        q_upper: upper joint limits [rad], seven.
        speed: joint speed limits [rad/s], seven.
        torque: joint torque limits [N m], seven.
        foot_speed: largest speed of the sole [m/s].
        joint7_mrad: largest displacement of the locked joint 7 [mrad].
        ft_stale_ms: age at which a force sample is flagged [ms].
        ft_stop_ms: age at which a trial is stopped [ms].
        ft_saturated_ms: how long the sensor may be beyond its range in a trial [ms].
        contact_force: of the ground on the foot, ends a trial [N].
        contact_force_hold: of the ground on the foot, ends in hold [N].
        contact_moment: of it about the sensor's origin, ends a trial [N m].
        contact_moment_hold: of it about the sensor's origin, ends in hold [N m].
        contact_growth: of the force within 0.5 s of a foot that stands, ends a trial
            [N].
        contact_force_move: of whatever is in the way of an arm that moves by itself,
            ends in hold [N]. The weight of a foot of 1 kg that is told on the wrong
            side makes 20.
        late_per_second: late cycles in a second that end in hold.
        still_ways: how far the sole may go in a trial while a motor stands still [m],
            seven. An arm that sticks moves joint 2 by one motor of its differential
            only. At the friction of another arm, motors 2 to 6 stood for 35, 17, 12,
            21 and 33 mm at most in simulated trials; joints 1 and 7 may stand.
        hold_after_missing: incomplete cycles in a row that end in hold.
        idle_after_missing: incomplete cycles in a row that end in idle.
        idle_after_late: cycles in a row in which positions came that were not asked
            for, and which end in idle; the first ends in hold.
        idle_after_safety_ms: age of the safety module's last answer that ends in idle
            [ms]; its questions leave every 50 ms, so the mode is unknown after 250.
        idle_after_late_ms: how long no cycle may have been in time [ms]; then the arm
            is idled. A stall is one late cycle, and does not count.
        idle_after_gap_ms: how long the loop may stand still [ms]. The safety module's
            heartbeat idles the arm after 100 ms.
        armed_inside: a joint's position limit counts after it was this far inside
            [rad]: the home position lies on two stops.
        motion: where a driven arm is taken for one that moves by itself.
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
    still_ways: Sequence[float] = (inf, 0.06, 0.06, 0.06, 0.06, 0.06, inf)
    hold_after_missing: int = 5
    idle_after_missing: int = 25
    idle_after_late: int = 3
    idle_after_safety_ms: float = 400.0
    idle_after_late_ms: float = 150.0
    idle_after_gap_ms: float = 200.0
    armed_inside: float = 0.1
    motion: MotionLimits = _MOTION

    def __post_init__(self) -> None:
        """Refuse a row that is too short: joints behind its end would have no limit."""
        rows = (self.q_lower, self.q_upper, self.speed, self.torque, self.still_ways)
        if any(len(row) != _JOINTS for row in rows):
            lengths = ", ".join(str(len(row)) for row in rows)
            raise ValueError(f"limits of {_JOINTS} joints have {lengths} numbers")


# A torque changes in one cycle by this share of its limit at most: from zero to the
# limit takes 20 ms. In simulated sessions the largest change of a driven arm is 0.041
# of it (1.8 N m at joint 2, when a trial begins to float), that of the locked joint 7
# 0.018. The start of torques, a step of 26 N m at joint 2, is spread over 12 ms
# behind idle; the pendant cannot activate the arm so soon after. Joint 7 is
# light and its lock stiff: held back as much, the lock throws the joint that it is to
# hold (17 rad/s after a twist of 1.2 N m); at 0.3 it does not, and one false position
# makes 0.8 rad/s.
TORQUE_STEP = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.3)
_GENTLE_STEP = tuple(0.99 * step for step in TORQUE_STEP)  # however it is rounded


def bounded_torque(tau: Vector, last: Vector, limits: Sequence[float]) -> Vector:
    """Return what may be sent of `tau` [N m], shape (7,); what is no number stays so.

    Args:
        tau: joint torques wanted [N m], shape (7,).
        last: joint torques as sent last [N m], shape (7,).
        limits: torque limits of the joints [N m], seven.
    """
    # Plain numbers: seven of them are bounded faster than numpy looks at an array, and
    # comparisons cost half of what `min` and `max` do. A NaN is neither less nor more.
    values, befores = tau.tolist(), last.tolist()
    is_gentle = are_within(map(sub, values, befores), map(mul, _GENTLE_STEP, limits))
    if is_gentle and are_within(values, limits):
        return tau
    rows = zip(values, befores, limits, TORQUE_STEP, strict=True)
    bounded: list[float] = []
    for wanted, before, limit, share in rows:
        step = share * limit
        low, high = before - step, before + step
        value = low if wanted < low else high if wanted > high else wanted
        bounded.append(-limit if value < -limit else limit if value > limit else value)
    return np.array(bounded)
