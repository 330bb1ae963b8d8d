"""Interfaces of the control law and of the observer of the foot."""

from collections.abc import Sequence
from typing import Protocol

from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.control_loop.states import ArmState
from acquisition.devices import ArmReading, Vector, WrenchSample
from acquisition.sample import Sample


class ControlLaw(Protocol):
    """Control law: joint torques from joint positions."""

    def enter(self, state: ArmState, reading: ArmReading) -> None:
        """Enter `state` without a jump in torque."""
        ...

    def torque(self, reading: ArmReading) -> tuple[Vector, Vector]:
        """Return (joint torques, their gravity part) [N m], shapes (7,)."""
        ...

    def move_to(self, goal: Vector, speed: float, reading: ArmReading) -> float:
        """Start a move to `goal` [rad], shape (7,), in hold; return its duration [s].

        `speed` limits the joints [rad/s].

        Raises:
            ValueError: the arm is not in hold, or `goal` is not reachable.
        """
        ...

    def start_powered_test(self, goal: PoweredTestGoal, reading: ArmReading) -> None:
        """Start the powered test `goal` in hold; its torques replace the control law.

        Raises:
            ValueError: the arm is not in hold, or `goal` is invalid.
        """
        ...

    def is_testing(self) -> bool:
        """Return whether the arm is in a powered test: any fault then leads to idle."""
        ...

    def powered_test_excess(
        self, reading: ArmReading, energy: float, *, is_powered: bool
    ) -> MotionExcess | None:
        """Return the limit of motion that a powered test exceeds, or None.

        Args:
            reading: reading of this cycle.
            energy: kinetic energy of the arm [J].
            is_powered: the motors have power.
        """
        ...

    def is_moving(self) -> bool:
        """Return whether a move is under way or its goal is kept."""
        ...

    def stuck_motor(self) -> int:
        """Return the motor that a move drives without moving it, 1-7; 0 = none."""
        ...

    def kinetic_energy(self, reading: ArmReading) -> float:
        """Return the kinetic energy of the arm with its foot [J]."""
        ...

    def joint7_offset(self, reading: ArmReading) -> float:
        """Return the offset of joint 7 from its locked position [rad].

        The lock is in `wam.control.joint_lock`.
        """
        ...


class FootObserver(Protocol):
    """Computes foot pose and traction from joints and wrench."""

    def observe(
        self, reading: ArmReading, wrench: WrenchSample | None, sample: Sample
    ) -> float:
        """Write foot pose, twist, wrench and traction; return the sole's speed."""
        ...

    def set_bias(self, bias: Sequence[float]) -> None:
        """Set the tare, taken in `experiments.run.tare`.

        Args:
            bias: the sensor's reading without load [N, N m], six numbers.
        """
        ...
