# pyright: reportMissingImports=false
"""Dynamics of the arm in substeps, semi-implicit Euler.

    (M + dt D) (qd' - qd) = dt (tau + J_s^T w_s + J_h^T w_h + T^T f - nle)
    q' = q + dt qd'

nle at q and qd + dt qdd / 2, M with drive inertia, w_s the ground's wrench at the sole,
w_h the hand's at the forearm, T the transmission, f the friction of the motors at qd.
D, the diagonal damping of friction and stops, is treated as an addition to the
armature, so one articulated-body pass solves the equation. The off-diagonal damping of
the differentials is smaller and taken explicitly, which stays stable.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from acquisition.clock import PERIOD_NS
from fakes.ground.contact import NO_CONTACT
from fakes.ground.terrain import Terrain
from fakes.plant.joints import GripTorques, JointDrives, JointLoads, JointState
from fakes.plant.model import ArmAndHand
from fakes.plant.push import HandView, Vector3
from wam.model.constants import Array

GRIP = (40.0, 1.0)  # orientation of the hand on the forearm: N m/rad, N m s/rad
NO_GRIP = (0.0, 0.0)


class HandLoad(NamedTuple):
    """Load of the hand in a cycle.

    Attributes:
        force: force on the hand point, including supported weight [N].
        grip: GRIP or NO_GRIP.
        sole: external force on the sole other than the ground's [N]; None = none.
        links: torques of hands on the links; None = no such hands.
    """

    force: Vector3
    grip: tuple[float, float]
    sole: Vector3 | None = None
    links: GripTorques | None = None


_LIFTED = [1, 3]  # joints 2 and 4
_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_NOTHING = (0.0,) * 6


class ArmBody:
    """Seven joints, foot on the ground, hand on the forearm; terrain frame.

    Attributes:
        disturbance: external joint torques [N m], shape (7,).
        drives: drives of the joints.
        rotation: frame 7 to terrain at the start of the cycle, shape (3, 3).
    """

    def __init__(
        self,
        parts: ArmAndHand,
        drives: JointDrives,
        j2mp: Array,
        q: Array,
        substep_ns: int,
    ) -> None:
        """Start at rest at `q`, held; the hand keeps its present orientation.

        Args:
            parts: model of the arm with the frames of sole and hand.
            drives: drives of the joints.
            j2mp: motor angle = j2mp @ joint angle, shape (7, 7).
            q: joint positions [rad], shape (7,).
            substep_ns: length of a substep [ns].
        """
        self._model, self._sole, self._hand = parts
        self._data = self._model.createData()
        self.drives, self.disturbance = drives, drives.disturbance
        self._dt = substep_ns * 1e-9
        # Mean time of the substeps' forces after the start of a cycle [s].
        midway = 5e-10 * (PERIOD_NS - substep_ns)
        self._midway = np.array([1.0, midway, 0.0])
        self._is_held = True
        self._sum = _NOTHING
        self._force, self._grip = (0.0, 0.0, 0.0), NO_GRIP
        self._pull: Vector3 | None = None
        self._joints = JointState(q, self._dt)
        self._loads = JointLoads(j2mp)
        pin.forwardKinematics(self._model, self._data, q)
        hand = pin.updateFramePlacement(self._model, self._data, self._hand)
        self._target_rotation = hand.rotation.copy()
        self.linearise()
        self._begin_drives(0)

    @property
    def q(self) -> Array:
        """Joint positions [rad], shape (7,); the array is not changed later."""
        return self._joints.rows[0]

    @property
    def qd(self) -> Array:
        """Joint velocities [rad/s], shape (7,); the array is not changed later."""
        return self._joints.rows[1]

    def move(self, q: Array) -> None:
        """Set the joint positions [rad], keeping the velocities."""
        self._joints.move(q)

    def hold(self, *, is_held: bool) -> None:
        """Support the arm in place (stand or person), or release it."""
        self._is_held = is_held
        if is_held:
            self._joints.rest(self.q)
            self._rates, self._speeds = [0.0] * 12, [0.0] * 7
            self.drives.rest()

    def drive(self, units: Sequence[float]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        self.drives.drive(units)

    def carried_force(self) -> Vector3:
        """Return the force at the hand that supports the arm's weight [N].

        In the plane of joints 2 and 4; gravity torques of the other joints are small.
        """
        weight = pin.computeGeneralizedGravity(self._model, self._data, self.q)
        lifted = self._loads.A[6:9:2, _LIFTED]  # along x and z
        x, z = np.linalg.lstsq(lifted.T, weight[_LIFTED], rcond=0.05)[0].tolist()
        return x, 0.0, z

    def unsupported_torques(self, hand: Vector3, sole: Vector3 | None) -> Array:
        """Return the gravity torques not supported by motors and forces [N m], (7,).

        Args:
            hand: force on the hand point [N].
            sole: force on the sole [N]; None = none.
        """
        weight = pin.computeGeneralizedGravity(self._model, self._data, self.q)
        supported = self.drives.driven + self._loads.A[6:9].T.dot(hand)
        if sole is not None:
            supported = supported + self._loads.A[:3].T.dot(sole)
        return weight - supported

    def hold_orientation(self) -> None:
        """Let the hand keep the present orientation of the forearm."""
        hand = pin.updateFramePlacement(self._model, self._data, self._hand)
        self._target_rotation = hand.rotation.copy()

    def counts(self) -> list[float]:
        """Return the counts of the motor encoders, seven."""
        return self.drives.counts(self.q).tolist()

    def motion(self) -> Sequence[float]:
        """Return position, velocity and angular velocity of the sole, nine numbers."""
        return (*self._sole_at, *self._rates[:6])

    def linearise(self) -> HandView:
        """Update frames and Jacobians once per cycle; return the hand's observation.

        Within the 2 ms, sole and hand move by the Jacobians; the joints and their
        dynamics are not linearised. All in the terrain frame.
        """
        model, data, A = self._model, self._data, self._loads.A
        pin.forwardKinematics(model, data, self.q)
        sole = pin.updateFramePlacement(model, data, self._sole)
        hand = pin.updateFramePlacement(model, data, self._hand)
        self.rotation = sole.rotation.copy()
        x, y, z = sole.translation.tolist()
        self._sole_at = (x, y, z)
        x, y, z = hand.translation.tolist()
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = self._target_rotation.dot(
            hand.rotation.T
        ).tolist()
        self._tilt = (0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy))
        pin.computeJointJacobians(model, data, self._midway.dot(self._joints.rows))
        A[:6] = pin.getFrameJacobian(model, data, self._sole, _AXES)
        A[6:12] = pin.getFrameJacobian(model, data, self._hand, _AXES)
        rates = A.dot(self.qd).tolist()
        self._rates, self._speeds = rates[:12], rates[12:]
        vx, vy, vz, _, _, _, hx, hy, hz, _, _, _ = self._rates
        return HandView(self._sole_at, (vx, vy, vz), (x, y, z), (hx, hy, hz))

    def begin_cycle(self, load: HandLoad, t_ns: int) -> None:
        """Refresh the quantities held constant during one cycle from `t_ns`."""
        self._force, self._grip, self._pull, self.drives.grip = load
        self._begin_drives(t_ns)

    def advance(self, steps: int, terrain: Terrain | None) -> None:
        """Advance by `steps` substeps within a cycle."""
        for _ in range(steps):
            self._step(terrain)

    def end_cycle(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the sum of the ground's wrenches over the substeps, and `motion`."""
        wrench_sum, self._sum = self._sum, _NOTHING
        return wrench_sum, self.motion()

    def _begin_drives(self, t_ns: int) -> None:
        self.drives.begin_cycle(self._joints.rows, self._speeds, t_ns)
        self._model.armature = self.drives.armature

    def _step(self, terrain: Terrain | None) -> None:
        sx, sy, sz, fx, fy, fz, _, _, _, wx, wy, wz = self._rates
        contact = NO_CONTACT
        if terrain is not None:
            contact = terrain.step(self._dt, (*self._sole_at, sx, sy, sz, fx, fy, fz))
        F_t, F_y, F_n, M_x, M_y, M_z = contact
        a, b, c, d, e, f = self._sum
        self._sum = (a - F_t, b + F_y, c + F_n, d + M_x, e + M_y, f + M_z)
        if not self._is_held:
            k, b = self._grip
            ex, ey, ez = self._tilt
            turned = (k * ex - b * wx, k * ey - b * wy, k * ez - b * wz)
            if self._pull is not None:
                px, py, pz = self._pull
                F_t, F_y, F_n = F_t - px, F_y + py, F_n + pz
            self._integrate((-F_t, F_y, F_n, M_x, M_y, M_z, *self._force, *turned))

    def _integrate(self, wrench: tuple[float, ...]) -> None:
        """Advance by one substep under `wrench` on foot and hand, twelve numbers."""
        dt, state, drives = self._dt, self._joints.rows, self.drives
        armature = drives.armature
        motor_torques = drives.torques(state, self._speeds)
        if drives.armature is not armature:
            self._model.armature = drives.armature
        tau = self._loads.torques(wrench, motor_torques, drives.driving)
        qdd = pin.aba(self._model, self._data, state[0], state[2], tau)
        motion = self._loads.A.dot(self._joints.step(qdd)[1]).tolist()
        self._rates, self._speeds = rates, speeds = motion[:12], motion[12:]
        drives.follow(speeds)
        sx, sy, sz, _, _, _, _, _, _, wx, wy, wz = rates
        x, y, z = self._sole_at
        self._sole_at = (x + dt * sx, y + dt * sy, z + dt * sz)
        x, y, z = self._tilt
        self._tilt = (x - dt * wx, y - dt * wy, z - dt * wz)
