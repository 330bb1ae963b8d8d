"""The control law: gravity, virtual mass, joint-7 lock, damping in hold."""

import numpy as np

from acquisition import ArmReading, Vector
from acquisition.control_loop import ArmState
from wam.control.joint_lock import JointLock, LockGains
from wam.control.joint_move import TOP_SPEED, JointMove, joint_pd
from wam.control.soft_walls import SoftWalls
from wam.model import ArmModel, VirtualMass, compensation

_JOINT7 = 6
MOVE_SHARE = 0.9  # of the torque limits that a move may use, gravity included


class FootController:
    """Torques of float, hold and damp (implements ControlLaw).

    float: gravity of everything plus the virtual mass, no damping, or slips would lose
    their bounce. hold and damp: gravity plus joint damping, virtual mass ramped to 0.
    Joint 7 is locked in all three, and soft walls stand before the stops. In hold the
    arm can be sent somewhere; joint PD then follows the move and keeps the goal until
    another state is entered.
    """

    def __init__(
        self,
        model: ArmModel,
        virtual_mass: float,
        gains: LockGains | None = None,
        walls: SoftWalls | None = None,
    ) -> None:
        self._model = model
        self._target_mass = virtual_mass
        self._mass = VirtualMass()
        self._lock = JointLock(gains)
        self._walls = walls
        self._largest = MOVE_SHARE * np.array(walls.limits) if walls else np.inf
        self._damping = model.constants.kd
        self._is_damped = True
        self._move: JointMove | None = None
        self._move_ns = 0

    def enter(self, state: ArmState, reading: ArmReading) -> None:
        """Begin `state`; torques change continuously except for the damping."""
        now = reading.host_ns
        self._move = None
        self._is_damped = state is not ArmState.FLOAT
        self._mass.aim(0.0 if self._is_damped else self._target_mass, now)
        if state in {ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP}:
            self._lock.engage(float(reading.q[_JOINT7]), now)
        else:
            self._lock.release(now)

    def move_to(self, goal: Vector, speed: float, reading: ArmReading) -> float:
        """Go to `goal` [rad], shape (7,), on a straight line; return how long [s].

        No joint is faster than `speed` [rad/s]. Joint 7 is released for the move. Only
        in hold.

        Raises:
            ValueError: the arm floats, `goal` is beyond a stop or not finite, or
                `speed` is not within 0..0.5 rad/s.
        """
        constants = self._model.constants
        if not self._is_damped:
            raise ValueError("the arm moves in hold only")
        is_inside = goal.shape == (7,) and bool(
            ((goal >= constants.q_lower) & (goal <= constants.q_upper)).all()
        )
        if not is_inside:
            raise ValueError(f"{goal} is no pose within the joint stops")
        if not 0.0 < speed <= TOP_SPEED:
            raise ValueError(f"{speed} rad/s is not within 0..{TOP_SPEED}")
        now = reading.host_ns
        start = reading.q.copy()
        if self._move is not None:  # from where it is held, or the torque would jump
            start = self._move.at((now - self._move_ns) * 1e-9)[0]
        self._lock.release(now)
        self._move = JointMove(start, goal.copy(), speed)
        self._move_ns = now
        return self._move.duration

    def torque(self, reading: ArmReading) -> tuple[Vector, Vector]:
        """Return (tau, gravity part) [N m], shapes (7,)."""
        now = reading.host_ns
        gravity = compensation(self._model, reading.q, self._mass.at(now))
        lock = self._lock.torque(float(reading.q[_JOINT7]), reading.qd7_raw, now)
        if self._move is not None:
            q, qd = self._move.at((now - self._move_ns) * 1e-9)
            constants = self._model.constants
            rate = qd - reading.qd
            pd = joint_pd(constants.kp, constants.kd, q - reading.q, rate)
            pd[_JOINT7] += lock  # fades from the moment of its release
            # A move never asks for what the guard would stop it for.
            tau = np.clip(gravity + pd, -self._largest, self._largest)
        else:
            tau = gravity.copy()
            if self._is_damped:
                tau -= self._damping * reading.qd
            tau[_JOINT7] = gravity[_JOINT7] + lock
        if self._walls is not None:
            self._walls.apply(tau, reading)
        return tau, gravity

    def joint7_offset(self, reading: ArmReading) -> float:
        """Return how far joint 7 is from where it was locked [rad]."""
        return self._lock.offset(float(reading.q[_JOINT7]), reading.host_ns)
