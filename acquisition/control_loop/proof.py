"""Proofs of an arm that is not known yet: little torque, idle at the first surprise.

An arm lies on its stops and is given no torque, that of one joint, or a share of its
weight. It may move only where it was pushed, and no further than here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from acquisition.clock import NS_PER_S


class ProofKind(IntEnum):
    """What is given to the arm.

    REST: nothing. RAMP: a torque of one joint that grows evenly, until the joint has
    moved. LIFT: a bounded torque that takes one joint slowly off its stop and back, and
    a small one that keeps the other joint of its motors where it is.
    GRAVITY: a share of the compensation of gravity that grows to the whole. SILENCE:
    nothing, and no position is asked for: the heartbeat of the module has to brake.
    """

    REST = 0
    RAMP = 1
    LIFT = 2
    GRAVITY = 3
    SILENCE = 4


@dataclass(frozen=True, slots=True)
class ProofGoal:
    """One proof.

    Attributes:
        kind: what is given.
        joint: the joint that is pushed, 1-7; 0 = none.
        torque: RAMP: at the end of the ramp; LIFT: the largest; its sign is that of the
            motion to come [N m].
        seconds: in which a ramp grows; SILENCE: that it lasts [s].
    """

    kind: ProofKind
    joint: int = 0
    torque: float = 0.0
    seconds: float = 1.0

    @property
    def silence_ns(self) -> int:
        """How long no position is asked for [ns]."""
        return round(self.seconds * NS_PER_S) if self.kind is ProofKind.SILENCE else 0

    @property
    def values(self) -> tuple[float, float, float, float]:
        """The numbers in order."""
        return float(self.kind), float(self.joint), self.torque, self.seconds

    @classmethod
    def of(cls, values: Sequence[float]) -> "ProofGoal":
        """Return the proof with these numbers."""
        kind, joint, torque, seconds = values[:4]
        return cls(ProofKind(int(kind)), int(joint), torque, seconds)


PARTNERS = {2: 3, 3: 2, 5: 6, 6: 5}  # joints that two motors turn together


@dataclass(frozen=True, slots=True)
class ProofLimits:
    """How far joints may go in a proof.

    Attributes:
        rest: of each joint without torque [rad], seven.
        reach: of the joint that is pushed; then it has moved [rad], seven.
        aside: of every other joint [rad].
        partner: of the other joint of the same two motors [rad]: where their friction
            differs, one of them slides first and turns it.
        lift_way: of a joint that is lifted [rad].
        lift_speed: of it [rad/s].
        beyond: of what is aimed at, on the way it is pushed [rad].
        gravity: of each joint under its compensation, as a multiple of `rest`.
        energy: kinetic energy of the arm [J].
        silence: longest time that no position is asked for [s]: twice what a module may
            take to brake.
    """

    rest: Sequence[float] = (0.008, 0.015, 0.015, 0.015, 0.030, 0.030, 0.030)
    reach: Sequence[float] = (0.008, 0.008, 0.008, 0.008, 0.015, 0.015, 0.020)
    aside: float = 0.025
    partner: float = 0.045
    lift_way: float = 0.080
    lift_speed: float = 0.05
    beyond: float = 0.025
    gravity: float = 1.5
    energy: float = 0.07
    silence: float = 0.3

    def aside_of(self, pushed: int, joint: int) -> float:
        """Return how far joint 1-7 may go while another is pushed [rad]."""
        return self.partner if PARTNERS.get(pushed) == joint else self.aside

    def ways(self, goal: ProofGoal) -> list[tuple[float, float]]:
        """Return between which ways each joint may be [rad], from where it began."""
        if goal.kind in (ProofKind.REST, ProofKind.SILENCE):
            return [(-way, way) for way in self.rest]
        if goal.kind is ProofKind.GRAVITY:
            return [(-self.gravity * way, self.gravity * way) for way in self.rest]
        i = goal.joint - 1
        asides = [self.aside_of(goal.joint, joint) for joint in range(1, 8)]
        ways = [(-aside, aside) for aside in asides]
        reach = self.lift_way if goal.kind is ProofKind.LIFT else self.reach[i]
        # The other way it may give as little as shows that it is the other way.
        low, high = -self.reach[i], reach + self.beyond
        ways[i] = (low, high) if goal.torque > 0.0 else (-high, -low)
        return ways


PROOF_LIMITS = ProofLimits()
