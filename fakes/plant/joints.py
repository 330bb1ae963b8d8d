"""Drives of the joints: motors, their friction, joint stops."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acquisition.clock import PERIOD_NS
from fakes.plant.friction import BristleFriction
from wam.model.arm_model import drive_inertia_matrix
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction

STOP_K, STOP_B = 2000.0, 20.0  # N m/rad, N m s/rad
NEAR = 0.05  # distance to a stop that no joint travels in 2 ms [rad]
BEARING_NS = 4 * PERIOD_NS  # between updates of load and ripple of the friction


class StopForces(NamedTuple):
    """Forces of the stops at one position and speed; seven numbers each.

    Attributes:
        torques: spring and damper torques [N m].
        damping: damping of touched stops [N m s/rad].
        is_near: a joint may reach a stop within a cycle.
    """

    torques: list[float]
    damping: list[float]
    is_near: bool


class GripTorques(NamedTuple):
    """Torques of hands on the links in a cycle; shapes (7,).

    tau = torques + K (target - q) - (B + K dt) qd', implicit in the speed at the end of
    a step, so that a stiff grip is stable.

    Attributes:
        torques: feed-forward torques: support and damping of the reference [N m].
        stiffness: K [N m/rad].
        damping: B [N m s/rad].
        target: reference joint positions [rad].
        strongest: limit of the spring torques [N m].
    """

    torques: Array
    stiffness: Array
    damping: Array
    target: Array
    strongest: Array

    def at(self, q: Array) -> Array:
        """Return the part independent of the speed at `q` [rad] [N m], shape (7,)."""
        pull = self.stiffness * (self.target - q)
        return self.torques + np.clip(pull, -self.strongest, self.strongest)

    def against(self, dt: float) -> Array:
        """Return the implicit damping of a step `dt` [s] [N m s/rad], shape (7,)."""
        return self.damping + dt * self.stiffness


class JointStops:
    """Stops of the seven joints: springs with dampers."""

    def __init__(self, constants: ArmConstants) -> None:
        """Set the stops of the arm."""
        lower, upper = constants.q_lower, constants.q_upper
        self._ends: list[list[float]] = np.stack((lower, upper), axis=-1).tolist()
        free = np.stack((lower + NEAR, upper - NEAR), axis=-1)
        self._free: list[list[float]] = free.tolist()

    def at(self, q: Sequence[float], qd: Sequence[float]) -> StopForces:
        """Return the forces of the stops.

        Args:
            q: joint positions [rad].
            qd: joint velocities [rad/s].
        """
        free = zip(q, self._free, strict=True)
        if all(low <= angle <= high for angle, (low, high) in free):
            return _CLEAR
        torques, damping = [0.0] * 7, [0.0] * 7
        for i, (angle, (lower, upper)) in enumerate(zip(q, self._ends, strict=True)):
            beyond = max(angle - upper, 0.0) - max(lower - angle, 0.0)
            if beyond:
                damping[i] = STOP_B
                torques[i] = -STOP_K * beyond - STOP_B * qd[i]
        return StopForces(torques, damping, is_near=True)


_CLEAR = StopForces([0.0] * 7, [0.0] * 7, is_near=False)


class JointDrives:
    """Torques at the joints other than gravity, ground and hand.

    Shorted windings add to the damping of a motor's friction.

    Attributes:
        disturbance: external joint torques [N m], shape (7,).
        driving: explicit joint torques of a step [N m], seven.
        stops: joint stops.
        grip: torques of hands on the links, or None.
        armature: drive inertia plus dt D [kg m^2], shape (7,).
    """

    def __init__(
        self,
        constants: ArmConstants,
        friction: MotorFriction,
        inertia: Array,
        dt: float,
        windings: Array,
    ) -> None:
        """Start at rest without torque, windings shorted.

        Args:
            constants: constants of the arm.
            friction: friction of the motors.
            inertia: effective inertia at each motor [kg m^2], shape (7,).
            dt: length of a step [s].
            windings: damping of each motor when shorted [N m s/rad], shape (7,).
        """
        self._dt = dt
        self._windings = windings
        self._turns = np.array(constants.cts) / (2.0 * np.pi)  # counts per radian
        self._to_counts = self._turns[:, None] * constants.j2mp
        self._j2mp, self._ipnm = constants.j2mp, constants.ipnm
        self._from_units = constants.j2mp.T / np.array(constants.ipnm, dtype=float)
        self._dampings = constants.j2mp.T**2  # maps motor to joint damping
        self._inertia = np.diag(drive_inertia_matrix(constants))
        self._bristles = BristleFriction(friction, inertia, dt)
        self._is_lively = False
        self.short([True] * 7)
        self.disturbance = np.zeros(7)
        self.stops = JointStops(constants)
        self._stopping = _CLEAR
        self.grip: GripTorques | None = None
        self._held_at = np.zeros(7)  # joint positions for the hands' springs
        self.armature = self._inertia
        self.drive([0.0] * 7)

    def counts(self, q: Array) -> Array:
        """Return the encoder counts at joint positions `q` [rad], shape (7,)."""
        return self._to_counts.dot(q)

    def drive(self, units: Sequence[float]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        self._tau = self._from_units.dot(np.array(units, dtype=float))
        self._units = tuple(units)
        self._add_up()

    def short(self, shorted: Sequence[bool]) -> None:
        """Short the windings of motors 1 to 7, or open them, from now on."""
        self._shorted = np.where(shorted, self._windings, 0.0)
        self._is_damped = any(shorted)
        self._is_outdated = True  # the armature is out of date

    def sent(self) -> list[float]:
        """Return the torques applied to motors 1 to 7 [N m]."""
        return [u / ipnm for u, ipnm in zip(self._units, self._ipnm, strict=True)]

    @property
    def driven(self) -> Array:
        """Joint torques of the motors [N m], shape (7,)."""
        return self._tau

    def rest(self) -> None:
        """Relax the bristles of a supported arm."""
        self._bristles.rest()

    def begin_cycle(self, rows: Array, speeds: Sequence[float], t_ns: int) -> None:
        """Refresh the quantities held constant during one cycle.

        Args:
            rows: joint positions [rad] and velocities [rad/s], shape (3, 7).
            speeds: motor speeds [rad/s], seven.
            t_ns: time [ns].
        """
        self._stop(rows)
        self._bear(rows, speeds, t_ns)
        self._is_lively = self._bristles.needs_fine_steps(speeds)
        self._resist(speeds)

    def torques(self, rows: Array, speeds: Sequence[float]) -> list[float]:
        """Return the friction torques on the motors in a step [N m], seven.

        Near a stop, or with a fast motor, the damping is updated first. Arguments as
        for `begin_cycle`.
        """
        if self._stopping.is_near or self.grip is not None:
            self._stop(rows)
            self._resist(speeds)
        elif self._is_lively or self._is_outdated:
            self._resist(speeds)
        friction = self._bristles.torques(speeds)
        if not self._is_damped:
            return friction
        return (np.array(friction) - self._shorted * speeds).tolist()

    def follow(self, speeds: Sequence[float]) -> None:
        """Advance the bristles by a step at motor speeds `speeds` [rad/s]."""
        self._bristles.follow(speeds)

    def _bear(self, rows: Array, speeds: Sequence[float], t_ns: int) -> None:
        if t_ns % BEARING_NS == 0:
            against = zip(self.sent(), self._bristles.torques(speeds), strict=True)
            net = [sent + friction for sent, friction in against]
            self._bristles.update_load(self._j2mp.dot(rows[0]).tolist(), net)

    def _stop(self, rows: Array) -> None:
        self._held_at = rows[0]
        self._stopping = self.stops.at(*rows[:2].tolist())
        self._add_up()

    def _resist(self, speeds: Sequence[float]) -> None:
        bristles = self._bristles
        bristles.take(speeds)
        damping = np.array(bristles.damping)
        if self._is_damped:
            damping += self._shorted
        armature = self._dampings.dot(damping)
        if self._stopping.is_near:
            armature += self._stopping.damping
        if self.grip is not None:
            armature += self.grip.against(self._dt)
        armature *= self._dt
        armature += self._inertia
        self._is_outdated = False
        self.armature = armature

    def _add_up(self) -> None:
        driving = self._tau + self.disturbance
        if self._stopping.is_near:
            driving += self._stopping.torques
        if self.grip is not None:
            driving += self.grip.at(self._held_at)
        self.driving: list[float] = driving.tolist()


class JointState:
    """Joint positions and velocities, shapes (7,); semi-implicit Euler (leapfrog).

    Velocities lag positions by half a step. The velocity-dependent part of the dynamics
    uses velocities advanced by half a step: otherwise a free swing loses energy.

    Attributes:
        rows: q [rad], qd [rad/s] and qd half a step later, shape (3, 7). A step makes a
            new array, so views of the old one stay valid.
    """

    def __init__(self, q: Array, dt: float) -> None:
        """Start at rest at `q` [rad] with steps of `dt` [s]."""
        # P (q, qd, qdd): q + dt (qd + dt qdd), qd + dt qdd, and dt / 2 later
        onward = [[1.0, dt, dt * dt], [0.0, 1.0, dt], [0.0, 1.0, 1.5 * dt]]
        self._P = np.array(onward)
        self.rest(q)

    def rest(self, q: Array) -> None:
        """Set the joints to rest at `q` [rad]."""
        self.rows = np.stack((q, np.zeros(7), np.zeros(7)))

    def move(self, q: Array) -> None:
        """Set the joint positions [rad], keeping the velocities."""
        self.rows = np.stack((q, *self.rows[1:]))

    def step(self, qdd: Array) -> Array:
        """Advance by a step with `qdd` [rad/s^2]; return the new rows."""
        rows = self.rows
        rows[2] = qdd
        self.rows = rows = self._P.dot(rows)
        return rows


class JointLoads:
    """Maps wrenches on foot and hand and motor torques to joint torques.

    Attributes:
        A: stacked Jacobians of sole (6 rows), hand (6) and motors (7), shape (19, 7);
            the first twelve rows are filled in place.
    """

    def __init__(self, j2mp: Array) -> None:
        """Set the transmission, motor angle = `j2mp` @ joint angle, shape (7, 7)."""
        self._B = np.vstack((np.zeros((12, 7)), j2mp, np.eye(7)))
        self.A = self._B[:19]

    def torques(
        self,
        wrench: Sequence[float],
        motors: Sequence[float],
        driving: Sequence[float],
    ) -> Array:
        """Return A^T (`wrench`, `motors`) + `driving` [N m], shape (7,).

        Args:
            wrench: wrenches on foot and hand, twelve numbers in the row order of A.
            motors: torques on the motors [N m], seven.
            driving: torques on the joints [N m], seven.
        """
        return np.array([*wrench, *motors, *driving]).dot(self._B)
