"""Torques of a powered test: zero, one joint's, or a share of gravity."""

import numpy as np

from acquisition.clock import NS_PER_S
from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.powered_tests import (
    PARTNERS,
    POWERED_TEST_LIMITS,
    PoweredTestGoal,
    PoweredTestKind,
    PoweredTestLimits,
)
from acquisition.devices import ArmReading, Vector
from wam.model.constants import ArmConstants

_JOINTS = 7
_KEEPS = 2.0  # times the friction of the CAD arm: holds the coupled joint in a lift
_AT_THE_TOP = 0.3  # s that a lifted joint stays up


class PoweredTest:
    """One powered test, relative to the pose in which the motors get power."""

    def __init__(
        self,
        goal: PoweredTestGoal,
        constants: ArmConstants,
        reading: ArmReading,
        limits: PoweredTestLimits = POWERED_TEST_LIMITS,
    ) -> None:
        """Begin at `reading`.

        Raises:
            ValueError: invalid goal: no such joint, a value that is not finite, or too
                long without feedback.
        """
        needs_joint = goal.kind in (PoweredTestKind.RAMP, PoweredTestKind.LIFT)
        if not (1 if needs_joint else 0) <= goal.joint <= _JOINTS:
            raise ValueError(f"there is no joint {goal.joint}")
        if not (np.isfinite(goal.torque) and 0.0 < goal.seconds <= 60.0):
            raise ValueError(f"{goal} is not a valid powered test")
        if goal.silence_ns > limits.silence * NS_PER_S:
            raise ValueError(f"{goal} leaves the arm unwatched for too long")
        self.goal = goal
        self._constants = constants
        self._limits = limits
        self._travel_limits = limits.travel_limits(goal)
        self._q: list[float] = []
        self._begun_ns = 0
        self._has_moved = False
        self._begin(reading)

    def _begin(self, reading: ArmReading) -> None:
        self._q = reading.q.tolist()
        self._begun_ns = reading.host_ns
        self._has_moved = False

    def torque(self, reading: ArmReading, gravity: Vector) -> Vector:
        """Return the torques [N m], shape (7,), given those of gravity compensation."""
        tau = np.zeros(_JOINTS)
        if reading.jump is not None:
            return tau
        goal, i = self.goal, self.goal.joint - 1
        seconds = (reading.host_ns - self._begun_ns) * 1e-9
        share = min(seconds / goal.seconds, 1.0)
        if goal.kind is PoweredTestKind.GRAVITY:
            return share * gravity
        if goal.kind is PoweredTestKind.RAMP:
            travel = float(reading.q[i]) - self._q[i]
            if travel * np.sign(goal.torque) >= self._limits.reach[i]:
                self._has_moved = True
            tau[i] = 0.0 if self._has_moved else share * goal.torque
        elif goal.kind is PoweredTestKind.LIFT:
            tau[i] = self._lift(reading, i, seconds)
            if partner := PARTNERS.get(goal.joint):
                limit = _KEEPS * float(self._constants.coulomb[partner - 1])
                tau[partner - 1] = self._pd_torque(reading, partner - 1, 0.0, limit)
        return tau

    def _lift(self, reading: ArmReading, i: int, seconds: float) -> float:
        """Return the torque that moves joint `i` up and back [N m]."""
        limits, goal = self._limits, self.goal
        up = limits.lift_travel / limits.lift_speed
        down = seconds - up - _AT_THE_TOP
        height = min(seconds / up, 1.0) if down <= 0.0 else 1.0 - down / up
        if height < 0.0:
            return 0.0  # back on its stop
        sense = float(np.sign(goal.torque))
        offset = sense * height * limits.lift_travel
        return self._pd_torque(reading, i, offset, abs(goal.torque))

    def _pd_torque(
        self, reading: ArmReading, i: int, offset: float, limit: float
    ) -> float:
        """Return the PD torque of joint `i` to start + `offset`, clipped to `limit`."""
        kp, kd = float(self._constants.kp[i]), float(self._constants.kd[i])
        reference = self._q[i] + offset
        torque = kp * (reference - float(reading.q[i])) - kd * float(reading.qd[i])
        return min(max(torque, -limit), limit)

    def excess(
        self, reading: ArmReading, energy: float, *, is_powered: bool
    ) -> MotionExcess | None:
        """Return the exceeded limit of motion, or None.

        Without power a person may move the arm: the test then restarts at its pose.

        Args:
            reading: reading of this cycle.
            energy: kinetic energy of the arm [J].
            is_powered: the motors have power.
        """
        if not is_powered:
            self._begin(reading)
            return None
        if energy > self._limits.energy:
            return MotionExcess("kinetic energy", energy, self._limits.energy, "J")
        rows = zip(reading.q.tolist(), self._q, self._travel_limits, strict=True)
        for number, (q, start, (low, high)) in enumerate(rows, 1):
            travel = q - start
            if not low <= travel <= high:
                limit = low if travel < low else high
                return MotionExcess(
                    f"the travel of joint {number}", travel, limit, "rad"
                )
        return None
