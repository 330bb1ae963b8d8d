"""Powered tests of an unknown arm with small torques and tight limits.

The arm lies on its stops and gets zero torque, that of one joint, or a share of gravity
compensation. It may move only in the pushed direction and within these limits; any
excess leads to idle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from acquisition.clock import NS_PER_S


class PoweredTestKind(IntEnum):
    """Torques applied to the arm.

    REST: none. RAMP: a linearly growing torque of one joint until it moves. LIFT: a
    bounded torque that moves one joint slowly off its stop and back, and a small one
    that holds the joint coupled to it. GRAVITY: gravity compensation, ramped up from 0.
    SILENCE: none, and no position requests: the module's heartbeat monitor has to brake
    the arm.
    """

    REST = 0
    RAMP = 1
    LIFT = 2
    GRAVITY = 3
    SILENCE = 4


@dataclass(frozen=True, slots=True)
class PoweredTestGoal:
    """Parameters of one powered test.

    Attributes:
        kind: kind of torque.
        joint: pushed joint, 1-7; 0 = none.
        torque: RAMP: torque at the end of the ramp; LIFT: largest torque; the sign is
            that of the expected motion [N m].
        seconds: duration of a ramp, or of SILENCE [s].
    """

    kind: PoweredTestKind
    joint: int = 0
    torque: float = 0.0
    seconds: float = 1.0

    @property
    def silence_ns(self) -> int:
        """Time without position requests [ns]."""
        return (
            round(self.seconds * NS_PER_S)
            if self.kind is PoweredTestKind.SILENCE
            else 0
        )

    @property
    def values(self) -> tuple[float, float, float, float]:
        """The parameters as numbers, for another process."""
        return float(self.kind), float(self.joint), self.torque, self.seconds

    @classmethod
    def of(cls, values: Sequence[float]) -> "PoweredTestGoal":
        """Return the goal with these `values`."""
        kind, joint, torque, seconds = values[:4]
        return cls(PoweredTestKind(int(kind)), int(joint), torque, seconds)


PARTNERS = {2: 3, 3: 2, 5: 6, 6: 5}  # joints coupled by a differential


@dataclass(frozen=True, slots=True)
class PoweredTestLimits:
    """Limits of the motion in a powered test.

    Attributes:
        rest: travel of each joint without torque [rad], seven.
        reach: travel at which the pushed joint counts as moved [rad], seven.
        aside: travel of every other joint [rad].
        partner: travel of the joint coupled by the differential [rad]: with unequal
            friction one motor slides first and turns it.
        lift_travel: travel of a lifted joint [rad].
        lift_speed: speed of a lifted joint [rad/s].
        beyond: overshoot beyond the goal in the pushed direction [rad].
        gravity: travel under gravity compensation as a multiple of `rest`.
        energy: kinetic energy of the arm [J].
        silence: longest time without position requests [s]: twice the time a module may
            take to brake.
    """

    rest: Sequence[float] = (0.008, 0.015, 0.015, 0.015, 0.030, 0.030, 0.030)
    reach: Sequence[float] = (0.008, 0.008, 0.008, 0.008, 0.015, 0.015, 0.020)
    aside: float = 0.025
    partner: float = 0.045
    lift_travel: float = 0.080
    lift_speed: float = 0.05
    beyond: float = 0.025
    gravity: float = 1.5
    energy: float = 0.07
    silence: float = 0.3

    def other_joint_travel(self, pushed: int, joint: int) -> float:
        """Return the travel limit of joint 1-7 while another is pushed [rad]."""
        return self.partner if PARTNERS.get(pushed) == joint else self.aside

    def travel_limits(self, goal: PoweredTestGoal) -> list[tuple[float, float]]:
        """Return the travel limits (low, high) of each joint from its start [rad]."""
        if goal.kind in (PoweredTestKind.REST, PoweredTestKind.SILENCE):
            return [(-travel, travel) for travel in self.rest]
        if goal.kind is PoweredTestKind.GRAVITY:
            return [
                (-self.gravity * travel, self.gravity * travel) for travel in self.rest
            ]
        i = goal.joint - 1
        asides = [self.other_joint_travel(goal.joint, joint) for joint in range(1, 8)]
        limits = [(-aside, aside) for aside in asides]
        reach = self.lift_travel if goal.kind is PoweredTestKind.LIFT else self.reach[i]
        # In the wrong direction only the travel that detects the motion is allowed.
        low, high = -self.reach[i], reach + self.beyond
        limits[i] = (low, high) if goal.torque > 0.0 else (-high, -low)
        return limits


POWERED_TEST_LIMITS = PoweredTestLimits()
