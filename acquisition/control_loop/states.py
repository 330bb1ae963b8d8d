"""What the arm can be doing, and what the loop asks of law and observer."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from acquisition.control_loop.guard import GuardVerdict
from acquisition.devices import ArmReading, SafetyMode, Vector, WrenchSample
from acquisition.sample import Sample


class ArmState(IntEnum):
    """What the arm is doing (architecture: safety states)."""

    IDLE = 0
    FLOAT = 1
    HOLD = 2
    DAMP = 3
    UNKNOWN = 4


class ControlLaw(Protocol):
    """Torques from positions."""

    def enter(self, state: ArmState, reading: ArmReading) -> None:
        """Begin `state` without a jump in torque."""
        ...

    def torque(self, reading: ArmReading) -> tuple[Vector, Vector]:
        """Return (joint torques, their gravity part) [N m], shapes (7,)."""
        ...

    def move_to(self, goal: Vector, speed: float, reading: ArmReading) -> float:
        """Go to `goal` [rad], shape (7,), in hold; return how long it takes [s].

        No joint is faster than `speed` [rad/s].

        Raises:
            ValueError: the arm is not in hold, or `goal` cannot be reached so.
        """
        ...

    def joint7_offset(self, reading: ArmReading) -> float:
        """Return how far joint 7 is from where it was locked [rad]."""
        ...


class FootObserver(Protocol):
    """Fills in what follows from joints and wrench: foot and traction."""

    def observe(
        self, reading: ArmReading, wrench: WrenchSample | None, sample: Sample
    ) -> float:
        """Write foot pose, twist, wrench and traction; return the sole's speed."""
        ...

    def set_bias(self, bias: Sequence[float]) -> None:
        """Take the sensor's reading without load [N, N m], six numbers."""
        ...


@dataclass(slots=True)
class ControlStatus:
    """What the console sees of the loop.

    Attributes:
        state: what the arm is doing.
        safety: what the safety circuit says.
        verdict: the worst the guard has said since the last request; None = nothing.
        ft_age_ns: age of the force sample [ns].
    """

    state: ArmState = ArmState.IDLE
    safety: SafetyMode = SafetyMode.UNKNOWN
    verdict: GuardVerdict | None = None
    ft_age_ns: int = 0
