"""The torques of a proof: none, one joint's, or a share of the weight."""

import numpy as np

from acquisition.clock import NS_PER_S
from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.proof import (
    PARTNERS,
    PROOF_LIMITS,
    ProofGoal,
    ProofKind,
    ProofLimits,
)
from acquisition.devices import ArmReading, Vector
from wam.model.constants import ArmConstants

_JOINTS = 7
_KEEPS = 2.0  # of another arm's friction: what keeps the partner of a lifted joint
_AT_THE_TOP = 0.3  # s, a lifted joint stays there


class Proof:
    """One proof, from where the arm lies when its motors get power."""

    def __init__(
        self,
        goal: ProofGoal,
        constants: ArmConstants,
        reading: ArmReading,
        limits: ProofLimits = PROOF_LIMITS,
    ) -> None:
        """Begin at `reading`.

        Raises:
            ValueError: the goal is none: no such joint, or a number that is not finite.
        """
        needs_joint = goal.kind in (ProofKind.RAMP, ProofKind.LIFT)
        if not (1 if needs_joint else 0) <= goal.joint <= _JOINTS:
            raise ValueError(f"there is no joint {goal.joint}")
        if not (np.isfinite(goal.torque) and 0.0 < goal.seconds <= 60.0):
            raise ValueError(f"{goal} is no proof")
        if goal.silence_ns > limits.silence * NS_PER_S:
            raise ValueError(f"{goal} leaves the arm unwatched for too long")
        self.goal = goal
        self._constants = constants
        self._limits = limits
        self._ways = limits.ways(goal)
        self._q: list[float] = []
        self._begun_ns = 0
        self._has_moved = False
        self._begin(reading)

    def _begin(self, reading: ArmReading) -> None:
        self._q = reading.q.tolist()
        self._begun_ns = reading.host_ns
        self._has_moved = False

    def torque(self, reading: ArmReading, gravity: Vector) -> Vector:
        """Return the torques [N m], shape (7,); `gravity` is what bears the arm."""
        tau = np.zeros(_JOINTS)
        if reading.jump is not None:
            return tau
        goal, i = self.goal, self.goal.joint - 1
        seconds = (reading.host_ns - self._begun_ns) * 1e-9
        share = min(seconds / goal.seconds, 1.0)
        if goal.kind is ProofKind.GRAVITY:
            return share * gravity
        if goal.kind is ProofKind.RAMP:
            way = float(reading.q[i]) - self._q[i]
            if way * np.sign(goal.torque) >= self._limits.reach[i]:
                self._has_moved = True
            tau[i] = 0.0 if self._has_moved else share * goal.torque
        elif goal.kind is ProofKind.LIFT:
            tau[i] = self._lift(reading, i, seconds)
            if partner := PARTNERS.get(goal.joint):
                most = _KEEPS * float(self._constants.coulomb[partner - 1])
                tau[partner - 1] = self._pull(reading, partner - 1, 0.0, most)
        return tau

    def _lift(self, reading: ArmReading, i: int, seconds: float) -> float:
        """Return the torque that takes joint `i` up and back [N m]."""
        limits, goal = self._limits, self.goal
        up = limits.lift_way / limits.lift_speed
        down = seconds - up - _AT_THE_TOP
        height = min(seconds / up, 1.0) if down <= 0.0 else 1.0 - down / up
        if height < 0.0:
            return 0.0  # it lies on its stop again
        sense = float(np.sign(goal.torque))
        way = sense * height * limits.lift_way
        return self._pull(reading, i, way, abs(goal.torque))

    def _pull(self, reading: ArmReading, i: int, way: float, most: float) -> float:
        """Return what pulls joint `i` to `way` from its begin, `most` at most [N m]."""
        kp, kd = float(self._constants.kp[i]), float(self._constants.kd[i])
        wanted = self._q[i] + way
        pull = kp * (wanted - float(reading.q[i])) - kd * float(reading.qd[i])
        return min(max(pull, -most), most)

    def excess(
        self, reading: ArmReading, energy: float, *, is_powered: bool
    ) -> MotionExcess | None:
        """Return what the arm does that it should not; None = nothing.

        Without power a hand may move it: it begins anew, where it is then.

        Args:
            reading: of this cycle.
            energy: kinetic energy of the arm [J].
            is_powered: its motors have power.
        """
        if not is_powered:
            self._begin(reading)
            return None
        if energy > self._limits.energy:
            return MotionExcess("kinetic energy", energy, self._limits.energy, "J")
        rows = zip(reading.q.tolist(), self._q, self._ways, strict=True)
        for number, (q, start, (low, high)) in enumerate(rows, 1):
            way = q - start
            if not low <= way <= high:
                limit = low if way < low else high
                return MotionExcess(f"the way of joint {number}", way, limit, "rad")
        return None
