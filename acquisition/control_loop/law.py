"""What a cycle asks of the control law and of the observer of the foot."""

from collections.abc import Sequence
from typing import Protocol

from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.proof import ProofGoal
from acquisition.control_loop.states import ArmState
from acquisition.devices import ArmReading, Vector, WrenchSample
from acquisition.sample import Sample


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

    def prove(self, goal: ProofGoal, reading: ArmReading) -> None:
        """Give the arm what `goal` says and nothing else, in hold.

        Raises:
            ValueError: the arm is not in hold, or `goal` is none.
        """
        ...

    def is_proving(self) -> bool:
        """Return whether the arm is in a proof: any verdict ends it in idle."""
        ...

    def proof_excess(
        self, reading: ArmReading, energy: float, *, is_powered: bool
    ) -> MotionExcess | None:
        """Return what an arm in a proof does that it should not; None = nothing.

        Args:
            reading: of this cycle.
            energy: kinetic energy of the arm [J].
            is_powered: its motors have power.
        """
        ...

    def is_moving(self) -> bool:
        """Return whether a move is made, or its goal is kept."""
        ...

    def stuck_motor(self) -> int:
        """Return the motor that a move turns in vain, 1-7; 0 = none."""
        ...

    def kinetic_energy(self, reading: ArmReading) -> float:
        """Return the kinetic energy of the arm with its foot [J]."""
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
