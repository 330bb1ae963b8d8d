# pyright: basic, reportMissingImports=false
"""The arm as a Pinocchio model: forward kinematics, Jacobian, gravity, mass matrix.

Standard (distal) Denavit-Hartenberg: T_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i). The
rotation comes first, so the constant part S_i of joint i is the placement of joint
i + 1, and link i, given in its distal frame, is attached at S_i.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wam.model.constants import GRAVITY, ArmConstants, Array, Body
from wam.model.tool import Tool


def urdf(constants: ArmConstants) -> str:
    """Return a URDF with links `wam_base`, `wam_l1`..`wam_l7`, `wam_tool`, 7 joints.

    Joint i + 1 is at S_i = Tz(d) Tx(a) Rx(alpha) of joint i; `wam_tool`, to which a
    viewer attaches sensor and foot, is at the end of the last link.
    """
    lines = [
        '<?xml version="1.0"?>',
        '<robot name="wam7">',
        '  <link name="wam_base"/>',
    ]
    parent = "wam_base"
    origin = "0 0 0", "0 0 0"
    for joint in range(7):
        child = f"wam_l{joint + 1}"
        low, high = constants.q_lower[joint], constants.q_upper[joint]
        lines += [
            f'  <link name="{child}"/>',
            f'  <joint name="wam_j{joint + 1}" type="revolute">',
            f'    <parent link="{parent}"/><child link="{child}"/>',
            f'    <origin xyz="{origin[0]}" rpy="{origin[1]}"/><axis xyz="0 0 1"/>',
            f'    <limit lower="{low}" upper="{high}" effort="50" velocity="4"/>',
            "  </joint>",
        ]
        parent = child
        origin = (
            f"{constants.a[joint]} 0 {constants.d[joint]}",
            f"{constants.alpha[joint]} 0 0",
        )
    lines += [
        '  <link name="wam_tool"/>',
        '  <joint name="wam_tool_plate" type="fixed">',
        f'    <parent link="{parent}"/><child link="wam_tool"/>',
        f'    <origin xyz="{origin[0]}" rpy="{origin[1]}"/>',
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, slots=True)
class FootPath:
    """Trajectory of the sole in the base frame.

    Attributes:
        position: centre of the sole [m], shape (n, 3).
        rotation: foot to base, shape (n, 3, 3).
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]


def _constant_part(constants: ArmConstants, joint: int) -> "pin.SE3":
    """Return S_i = Tz(d) Tx(a) Rx(alpha) of joint `joint` (0-6)."""
    alpha = constants.alpha[joint]
    c, s = np.cos(alpha), np.sin(alpha)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    translation = np.array([constants.a[joint], 0.0, constants.d[joint]])
    return pin.SE3(rotation, translation)


def _inertia(body: Body) -> "pin.Inertia":
    return pin.Inertia(body.mass, body.com, body.inertia)


def build_pinocchio(
    constants: ArmConstants, bodies: tuple[Body, ...] = ()
) -> "pin.Model":
    """Return a Pinocchio model with `bodies` (in frame 7) on the tool plate."""
    model = pin.Model()
    model.name = "wam7"
    parent = 0
    for joint in range(7):
        placement = pin.SE3.Identity()
        if joint > 0:
            placement = _constant_part(constants, joint - 1)
        parent = model.addJoint(
            parent, pin.JointModelRZ(), placement, f"wam_j{joint + 1}"
        )
        offset = _constant_part(constants, joint)
        link = offset.act(_inertia(constants.links[joint]))
        model.appendBodyToJoint(parent, link, pin.SE3.Identity())
    plate = _constant_part(constants, 6)
    for body in bodies:
        model.appendBodyToJoint(parent, plate.act(_inertia(body)), pin.SE3.Identity())
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    model.lowerPositionLimit = constants.q_lower
    model.upperPositionLimit = constants.q_upper
    return model


def add_point(
    model: "pin.Model", constants: ArmConstants, name: str, point: Array
) -> int:
    """Add a frame at `point` [m] of frame 7, axes of frame 7; return its index."""
    placement = _constant_part(constants, 6) * pin.SE3(np.eye(3), point)
    return model.addFrame(pin.Frame(name, 7, 0, placement, pin.FrameType.OP_FRAME))


def drive_inertia_matrix(constants: ArmConstants) -> Array:
    """Return j2mp^T diag(rotor inertia) j2mp [kg m^2], shape (7, 7)."""
    j2mp = constants.j2mp
    return j2mp.T @ np.diag(constants.drive_inertia) @ j2mp


class ArmModel:
    """Kinematics and dynamics of the arm with its tool.

    Results are in the base frame: origin at the intersection of the axes of joints 1
    and 2, z up. Returned arrays are new, nothing is shared between calls.
    """

    def __init__(self, constants: ArmConstants, tool: Tool | None = None) -> None:
        bodies = (tool.sensor, tool.foot) if tool else ()
        self.constants = constants
        self.tool = tool
        self._model = build_pinocchio(constants, bodies)
        zero = np.zeros(3)
        self._plate = add_point(self._model, constants, "tool_plate", zero)
        sole = tool.sole if tool else zero
        foot_com = tool.foot.com if tool else zero
        self._sole = add_point(self._model, constants, "sole", sole)
        self._foot_com = add_point(self._model, constants, "foot_com", foot_com)
        self._data = self._model.createData()
        self._drive = drive_inertia_matrix(constants)

    def gravity(self, q: Array) -> Array:
        """Return the torques that hold the arm, dV/dq [N m], shape (7,)."""
        return pin.computeGeneralizedGravity(self._model, self._data, q).copy()

    def weight_torque(self, q: Array, mass: float) -> Array:
        """Return J_c^T (0, 0, -m g) [N m]: weight of `mass` [kg] at the foot's centre.

        Shape (7,).
        """
        jacobian = pin.computeFrameJacobian(
            self._model, self._data, q, self._foot_com, _AXES
        )
        return jacobian[2] * (-mass * GRAVITY)

    def mass_matrix(self, q: Array, *, with_drive: bool = True) -> Array:
        """Return M(q) [kg m^2], shape (7, 7), by default with the drive inertia."""
        upper = np.triu(pin.crba(self._model, self._data, q))
        matrix = upper + np.triu(upper, 1).T
        return matrix + self._drive if with_drive else matrix

    def kinetic_energy(self, q: Array, qd: Array) -> float:
        """Return E = 1/2 qd^T M(q) qd with the drive inertia [J]."""
        links = pin.computeKineticEnergy(self._model, self._data, q, qd)
        return float(links + 0.5 * qd.dot(self._drive.dot(qd)))

    def coriolis(self, q: Array, qd: Array) -> Array:
        """Return C(q, qd) qd of the links [N m], shape (7,)."""
        bias = pin.nonLinearEffects(self._model, self._data, q, qd)
        return bias - pin.computeGeneralizedGravity(self._model, self._data, q)

    def plate_pose(self, q: Array) -> tuple[Array, Array]:
        """Return (position [m] (3,), rotation (3, 3)) of the tool plate, frame 7."""
        return self._pose(q, self._plate)

    def sole_pose(self, q: Array) -> tuple[Array, Array]:
        """Return (position [m] (3,), rotation (3, 3)) of the sole."""
        return self._pose(q, self._sole)

    def foot_com_position(self, q: Array) -> Array:
        """Return the foot's centre of mass [m], shape (3,)."""
        return self._pose(q, self._foot_com)[0]

    def plate_jacobian(self, q: Array) -> Array:
        """Return the Jacobian of the tool plate, linear then angular, shape (6, 7)."""
        return self._jacobian(q, self._plate)

    def sole_jacobian(self, q: Array) -> Array:
        """Return the Jacobian of the sole, linear then angular, shape (6, 7)."""
        return self._jacobian(q, self._sole)

    def sole_motion(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """Return (pose (7,), rotation (3, 3), twist (6,)) of the sole.

        Pose: position [m] and quaternion x y z w, w >= 0. Twist: linear [m/s], then
        angular [rad/s].
        """
        pin.forwardKinematics(self._model, self._data, q, qd)
        placement = pin.updateFramePlacement(self._model, self._data, self._sole)
        velocity = pin.getFrameVelocity(self._model, self._data, self._sole, _AXES)
        pose = pin.SE3ToXYZQUAT(placement)
        if pose[6] < 0.0:
            quaternion = pose[3:]
            np.negative(quaternion, quaternion)
        return pose, placement.rotation, velocity.vector

    def sole_path(self, q: NDArray[np.float64]) -> FootPath:
        """Return the trajectory of the sole for joint positions `q` [rad], (n, 7).

        Vectorised over the rows; agrees with `sole_pose` to 1e-14.
        """
        joint_angles = np.ascontiguousarray(q.T)
        sines, cosines = np.sin(joint_angles), np.cos(joint_angles)
        axes = np.repeat(np.eye(3)[:, :, None], len(q), axis=2)
        x, y, z = axes
        position = np.zeros_like(x)
        for joint in range(7):
            _rotate(x, y, cosines[joint], sines[joint])
            step = _constant_part(self.constants, joint)
            a, _, d = step.translation
            if a or d:
                position += a * x + d * z
            _rotate(y, z, step.rotation[1, 1], step.rotation[2, 1])
        sole = self.tool.sole if self.tool else np.zeros(3)
        position += sole[0] * x + sole[1] * y + sole[2] * z
        columns = np.ascontiguousarray(axes.transpose(2, 1, 0))
        return FootPath(np.ascontiguousarray(position.T), columns)

    def _pose(self, q: Array, frame: int) -> tuple[Array, Array]:
        pin.forwardKinematics(self._model, self._data, q)
        placement = pin.updateFramePlacement(self._model, self._data, frame)
        return placement.translation.copy(), placement.rotation.copy()

    def _jacobian(self, q: Array, frame: int) -> Array:
        return pin.computeFrameJacobian(self._model, self._data, q, frame, _AXES).copy()


def _rotate(u: Array, v: Array, c: Array, s: Array) -> None:
    """Rotate the axes u and v in place: c u + s v and c v - s u, shapes (3, n)."""
    to_u, from_v = s * v, s * u
    u *= c
    u += to_u
    v *= c
    v -= from_v
