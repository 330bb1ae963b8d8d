"""The control law: gravity, virtual mass, joint-7 lock, position hold, moves."""

from dataclasses import dataclass

import numpy as np

from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.law import ControlLaw
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.control_loop.states import ArmState
from acquisition.devices import ArmReading, Vector
from wam.control.friction_compensation import FrictionCompensation
from wam.control.joint_lock import LOCKED_JOINT, JointLock, LockGains
from wam.control.position_control import (
    TOP_SPEED,
    JointMove,
    PositionHold,
    StallDetector,
    joint_pd,
    move_reference,
)
from wam.control.powered_tests import PoweredTest
from wam.control.soft_walls import SoftWalls
from wam.model.arm_model import ArmModel
from wam.model.gravity import VirtualMass, compensation

TORQUE_SHARE = 0.9  # of the torque limits: bound of a move or hold including gravity
_SPRING_STATES = frozenset({ArmState.HOLD, ArmState.DAMP, ArmState.GUIDE})
_POWERED = frozenset({ArmState.FLOAT, *_SPRING_STATES})


@dataclass(slots=True, eq=False)
class MoveMode:
    """Mode of an arm in hold that makes a move or keeps its goal.

    Attributes:
        path: joint path.
        begun_ns: start time of the move [ns].
        stuck_motor: motor driven without moving, 1-7; 0 = none.
    """

    path: JointMove
    begun_ns: int
    stuck_motor: int = 0

    def reference(self, now_ns: int) -> tuple[Vector, Vector]:
        """Return reference (positions [rad], velocities [rad/s]), shapes (7,)."""
        return move_reference(self.path, (now_ns - self.begun_ns) * 1e-9)


# In hold an arm may move or be in a powered test; the other modes are plain states.
Mode = ArmState | MoveMode | PoweredTest


class FootController(ControlLaw):
    """Torques of float, guide, hold and damp.

    float: gravity compensation of arm and tool plus the virtual mass, without damping,
    which would suppress the bounce-back of slips; if calibrated, most of the drives'
    dry friction is compensated. hold and damp: gravity compensation, joint damping and
    position springs of bounded torque. guide: the same, weak enough to be led by hand.
    The virtual mass is ramped to 0 in all states but float. Joint 7 is locked in all
    four, and soft walls act before the stops. In hold the arm can make a move: joint PD
    follows it and keeps the goal until a state is entered, hold included.
    """

    def __init__(
        self,
        model: ArmModel,
        virtual_mass: float,
        gains: LockGains | None = None,
        walls: SoftWalls | None = None,
        friction: FrictionCompensation | None = None,
    ) -> None:
        self._model = model
        self._friction = friction
        self._target_mass = virtual_mass
        self._mass = VirtualMass()
        self._lock = JointLock(gains)
        self._hold = PositionHold(model.constants)
        self._walls = walls
        limits = np.array(walls.limits) if walls else np.full(7, np.inf)
        self._largest = TORQUE_SHARE * limits
        self._mode: Mode = ArmState.IDLE
        self._watch = StallDetector(model.constants)

    def enter(self, state: ArmState, reading: ArmReading) -> None:
        """Enter `state`; torques are continuous except for the damping.

        A move ends. Entering the present hold state again changes nothing.
        """
        now = reading.host_ns
        if state not in _SPRING_STATES:
            self._hold.release()
        elif state is self._mode:
            return
        else:
            self._hold.begin(reading.q, self._move_spring(reading))
        if self._friction is not None and state is not ArmState.FLOAT:
            self._friction.stop(now)
        self._mode = state
        self._mass.aim(self._target_mass if state is ArmState.FLOAT else 0.0, now)
        if state in _POWERED:
            self._lock.engage(float(reading.q[LOCKED_JOINT]), now)
        else:
            self._lock.release(now)

    def move_to(self, goal: Vector, speed: float, reading: ArmReading) -> float:
        """Start a straight move to `goal` [rad], shape (7,); return its duration [s].

        `speed` [rad/s] limits all joints but joint 7, which is released for the move
        and turns at 0.5 rad/s. Only in hold.

        Raises:
            ValueError: the arm is not in hold, `goal` is beyond a stop or not finite,
                or `speed` is not within 0..0.5 rad/s.
        """
        constants, mode = self._model.constants, self._mode
        if self.is_testing() or (
            isinstance(mode, ArmState) and mode is not ArmState.HOLD
        ):
            raise ValueError("the arm moves in hold only")
        is_inside = goal.shape == (7,) and bool(
            ((goal >= constants.q_lower) & (goal <= constants.q_upper)).all()
        )
        if not is_inside:
            raise ValueError(f"{goal} is not a pose within the joint stops")
        if not 0.0 < speed <= TOP_SPEED:
            raise ValueError(f"{speed} rad/s is not within 0..{TOP_SPEED}")
        now = reading.host_ns
        # Start at the reference of the spring, not at q: the torque stays continuous.
        if isinstance(mode, MoveMode):
            start, _ = mode.reference(now)
        else:
            start = reading.q + self._hold.spring(reading) / constants.kp
        self._hold.release()
        self._lock.release(now)
        path = JointMove(start, goal.copy(), speed)
        self._mode = MoveMode(path, now)
        self._watch.begin()
        return path.duration

    def start_powered_test(self, goal: PoweredTestGoal, reading: ArmReading) -> None:
        """Start the powered test `goal` in hold; its torques replace the control law.

        Raises:
            ValueError: the arm is not in hold or moves, or `goal` is invalid.
        """
        if self._mode is not ArmState.HOLD and not self.is_testing():
            raise ValueError("a powered test begins in hold only")
        self._mode = PoweredTest(goal, self._model.constants, reading)
        self._hold.release()
        self._lock.release(reading.host_ns)

    def is_testing(self) -> bool:
        """Return whether the arm is in a powered test: any fault then leads to idle."""
        return isinstance(self._mode, PoweredTest)

    def powered_test_excess(
        self, reading: ArmReading, energy: float, *, is_powered: bool
    ) -> MotionExcess | None:
        """Return the limit of motion that a powered test exceeds, or None."""
        if not isinstance(self._mode, PoweredTest):
            return None
        return self._mode.excess(reading, energy, is_powered=is_powered)

    def torque(self, reading: ArmReading) -> tuple[Vector, Vector]:
        """Return (tau, gravity part) [N m], shapes (7,).

        While a position is implausible (`reading.jump`), only gravity is compensated,
        until the positions are confirmed.
        """
        now = reading.host_ns
        gravity = compensation(self._model, reading.q, self._mass.at(now))
        if isinstance(self._mode, PoweredTest):
            tau = self._mode.torque(reading, gravity)
            return tau, tau.copy()
        if reading.jump is not None:
            return gravity.copy(), gravity
        lock = self._lock_torque(reading)
        match self._mode:
            case MoveMode() as move:
                tau = self._move_torque(move, reading, gravity, lock)
            case ArmState.FLOAT:
                tau = gravity.copy()
                tau[LOCKED_JOINT] += lock
            case ArmState.GUIDE:
                tau = self._hold_torque(reading, gravity, lock, is_guided=True)
            case _:  # hold and damp; in idle the cycle does not call this
                tau = self._hold_torque(reading, gravity, lock)
        if self._friction is not None:
            self._compensate(self._friction, tau, reading)
        if self._walls is not None:
            self._walls.apply(tau, reading)
        return tau, gravity

    def is_moving(self) -> bool:
        """Return whether a move is under way or its goal is kept."""
        return isinstance(self._mode, MoveMode)

    def stuck_motor(self) -> int:
        """Return the motor that a move drives without moving it, 1-7; 0 = none."""
        return self._mode.stuck_motor if isinstance(self._mode, MoveMode) else 0

    def kinetic_energy(self, reading: ArmReading) -> float:
        """Return the kinetic energy of the arm with its foot [J]."""
        return self._model.kinetic_energy(reading.q, reading.qd)

    def joint7_offset(self, reading: ArmReading) -> float:
        """Return the offset of joint 7 from its locked position [rad]."""
        return self._lock.offset(float(reading.q[LOCKED_JOINT]), reading.host_ns)

    def _lock_torque(self, reading: ArmReading) -> float:
        """Return the torque of joint 7's lock [N m]; 0 after it has faded."""
        q7 = float(reading.q[LOCKED_JOINT])
        if isinstance(self._mode, MoveMode) or self._mode in _SPRING_STATES:
            self._lock.follow(q7, reading.host_ns)
        return self._lock.torque(q7, reading.qd7_raw, reading.host_ns)

    def _move_torque(
        self, move: MoveMode, reading: ArmReading, gravity: Vector, lock: float
    ) -> Vector:
        """Return `gravity` plus the PD torque of a move [N m], shape (7,).

        Clipped below the torque limits, so that a move never trips the guard.
        """
        constants = self._model.constants
        q, qd = move.reference(reading.host_ns)
        tau = gravity + joint_pd(
            constants.kp, constants.kd, q - reading.q, qd - reading.qd
        )
        tau[LOCKED_JOINT] += lock  # fades after its release
        tau = np.clip(tau, -self._largest, self._largest)
        move.stuck_motor = self._watch.stuck_motor(q, tau - gravity, reading)
        return tau

    def _hold_torque(
        self,
        reading: ArmReading,
        gravity: Vector,
        lock: float,
        *,
        is_guided: bool = False,
    ) -> Vector:
        """Return `gravity` plus springs and dampers [N m], shape (7,).

        The sum is bounded by a share of the torque limit: otherwise braking a fast arm
        would trip the guard.
        """
        tau = self._hold.torque(reading, is_guided=is_guided)
        # Python floats: for seven values the loop is faster than numpy calls.
        rows = zip(tau.tolist(), gravity.tolist(), self._largest.tolist(), strict=True)
        tau = gravity + np.array([_clipped(*row) for row in rows])
        tau[LOCKED_JOINT] = gravity[LOCKED_JOINT] + lock
        return tau

    def _compensate(
        self, friction: FrictionCompensation, tau: Vector, reading: ArmReading
    ) -> None:
        """Add the friction compensation to `tau` [N m], except at joint 7 (locked)."""
        if self._mode is ArmState.FLOAT:
            depth = None if self._walls is None else self._walls.depth(reading.q)
            tau[:LOCKED_JOINT] += friction.torque(reading, tau, depth)[:LOCKED_JOINT]
        elif (fading := friction.fading_torque(reading.host_ns)) is not None:
            tau[:LOCKED_JOINT] += fading[:LOCKED_JOINT]
            np.clip(tau, -self._largest, self._largest, out=tau)

    def _move_spring(self, reading: ArmReading) -> Vector | None:
        """Return the spring torque of a move [N m], shape (7,); None without a move.

        The springs of hold take over with this torque.
        """
        if not isinstance(self._mode, MoveMode):
            return None
        q, _ = self._mode.reference(reading.host_ns)
        constants = self._model.constants
        return joint_pd(constants.kp, constants.kd, q - reading.q, np.zeros(7))


def _clipped(tau: float, gravity: float, limit: float) -> float:
    """Return `tau` clipped so that |tau + gravity| <= `limit` [N m]."""
    return min(max(tau, min(-limit - gravity, 0.0)), max(limit - gravity, 0.0))
