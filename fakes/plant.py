# pyright: reportMissingImports=false
"""The arm as a body: seven joints, foot on the ground, hand on the forearm.

    (M + dt D) qd' = M qd + dt (tau + J_s^T w_s + J_h^T w_h - nle),   q' = q + dt qd'

M with drive inertia, D the secant of Coulomb and viscous friction taken implicitly,
w_s the ground's force at the sole, w_h the hand's at the forearm. The implicit part is
an addition to the armature, so one articulated-body pass solves it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from fakes.contact import NO_CONTACT, Contact, Motion
from fakes.hand import Hand, HandView
from fakes.terrain import Terrain
from fakes.truth import Truth
from ft_sensor.payload import Payload, TerrainFrame, cross_matrix, payload_of
from wam.constants import GRAVITY, ArmConstants, Array, Body
from wam.model import add_point, build_pinocchio, drive_inertia_matrix
from wam.tool import Tool

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
CYCLE_NS = 2_000_000
FOREARM_MASS = 1.0  # of the person's arm, carried by the person [kg]
_HAND_ABOVE_PLATE = 0.030  # on the axis of joint 7 [m]
_GRIP = (40.0, 1.0)  # the hand keeps the forearm's turn: N m/rad, N m s/rad
_NO_GRIP = (0.0, 0.0)
_STOP_K, _STOP_B = 2000.0, 20.0  # joint stops: N m/rad, N m s/rad
_EPSILON = 0.01  # rad/s, where Coulomb friction saturates
_STANDSTILL = 1e-9  # rad/s, keeps the secant finite


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """How the simulated arm differs from an ideal one.

    Attributes:
        friction: share of the joint friction identified on another arm.
        substeps: steps per 2 ms cycle.
    """

    friction: float = 0.05
    substeps: int = 4


class ArmPlant:
    """Implements fakes.puck_bank.MotorSide with the dynamics of the whole arm."""

    def __init__(
        self,
        constants: ArmConstants,
        tool: Tool,
        frame: TerrainFrame,
        q: Array,
        options: PlantOptions | None = None,
    ) -> None:
        options = options or PlantOptions()
        self._constants = constants
        self._payload: Payload = payload_of(tool)
        sole_in_sensor = self._payload.rotation.T @ (
            tool.sole - np.array([0.0, 0.0, tool.sensor_height])
        )
        self._sole_cross = cross_matrix(sole_in_sensor)
        self._com_cross = cross_matrix(self._payload.com)
        model = build_pinocchio(constants, (tool.sensor, tool.foot))
        self._build_hand(model, constants, constants.d[6] - _HAND_ABOVE_PLATE)
        self._sole = add_point(model, constants, "sole", tool.sole)
        self._model = model
        self._data = model.createData()
        self._drive = np.diag(drive_inertia_matrix(constants)).copy()
        self._coulomb = options.friction * constants.coulomb
        self._viscous = options.friction * constants.viscous
        self._substep_ns = CYCLE_NS // options.substeps
        self._dt = self._substep_ns * 1e-9
        self._frame = frame
        self._R = frame.axes()
        self._A = np.zeros((9, 7))
        self._origin = np.array(frame.far_end)
        self._up = (self._R[:, 2] * FOREARM_MASS * GRAVITY).tolist()
        self._middle = (constants.q_upper + constants.q_lower) / 2.0
        self._reach = (constants.q_upper - constants.q_lower) / 2.0
        self.q = q.copy()
        self.qd = np.zeros(7)
        self._to_units = np.array(constants.ipnm, dtype=float)
        self._tau = np.zeros(7)
        self._is_held = True
        self.disturbance = np.zeros(7)  # joint torques from outside [N m]
        self.terrain: Terrain | None = None
        self.hand = Hand(self._dt)
        self.t_ns = 0
        self._sole_at = self._hand_at = self._tilt = (0.0, 0.0, 0.0)
        self.truth: Truth | None = None
        self._cycle_force, self._sum_force = np.zeros(3), np.zeros(3)
        self._cycle_v, self._cycle_a = np.zeros(3), np.zeros(3)
        self._parts = 0
        pin.computeJointJacobians(model, self._data, self.q)
        self._wanted = self._hand_rotation()
        self._linearise()

    def _build_hand(
        self, model: "pin.Model", constants: ArmConstants, height: float
    ) -> None:
        alpha = constants.alpha[5]
        c, s = np.cos(alpha), np.sin(alpha)
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        link = pin.SE3(tilt, np.array([constants.a[5], 0.0, constants.d[5]]))
        placement = link * pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        frame = pin.Frame("hand", 6, 0, placement, pin.FrameType.OP_FRAME)
        self._hand = model.addFrame(frame)
        arm = Body(FOREARM_MASS, np.zeros(3), np.zeros((3, 3)))
        inertia = pin.Inertia(arm.mass, arm.com, arm.inertia)
        model.appendBodyToJoint(6, placement.act(inertia), pin.SE3.Identity())

    # --- what the pucks see -------------------------------------------------------

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`, in whole substeps."""
        while self.t_ns + self._substep_ns <= t_ns:
            self._step()

    def counts(self) -> Sequence[int]:
        """Return encoder counts of the seven motors."""
        angle = self._constants.j2mp @ self.q
        scale = np.array(self._constants.cts) / (2.0 * np.pi)
        return np.floor(angle * scale).astype(int).tolist()

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        motor = np.asarray(units, dtype=float) / self._to_units
        self._tau = self._constants.j2mp.T @ motor

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Hold the joints (braked), or let them follow torque or fall."""
        self._is_held = is_braked and is_powered
        if self._is_held:
            self.qd = np.zeros(7)
        if is_braked or not is_powered:
            self._tau = np.zeros(7)

    # --- what the sensor feels ----------------------------------------------------

    def sensor_load(self, t_ns: int) -> tuple[float, float, float, float, float, float]:
        """Return the load on the wrist sensor in its own frame [N, N m].

        f = F_c + m_b (g_w - a): ground, weight and inertia of what hangs below.
        """
        self.advance(t_ns)
        placement = self._data.oMf[self._sole]
        to_sensor = (placement.rotation @ self._payload.rotation).T
        contact = to_sensor @ (self._R.T @ self._cycle_force)
        fall = -GRAVITY * to_sensor[:, 2] - to_sensor @ (self._R.T @ self._cycle_a)
        weight = self._payload.mass * fall
        sign = self._payload.sign
        fx, fy, fz = (sign * (contact + weight)).tolist()
        moment = self._sole_cross @ contact + self._com_cross @ weight
        tx, ty, tz = (sign * moment).tolist()
        return fx, fy, fz, tx, ty, tz

    # --- the world ----------------------------------------------------------------

    @property
    def is_touching(self) -> bool:
        """Whether the ground carries anything."""
        return bool(self._cycle_force[2] > 0.05)

    @property
    def foot_speed(self) -> float:
        """Speed of the sole [m/s]."""
        return float(np.linalg.norm(self._cycle_v))

    def start_truth(self) -> None:
        """Begin to write down what really happens."""
        self.truth = Truth()

    def take_truth(self) -> Truth:
        """Return what happened since the last call."""
        taken = self.truth or Truth()
        self.truth = Truth()
        return taken

    def _hand_rotation(self) -> Array:
        placement = pin.updateFramePlacement(self._model, self._data, self._hand)
        return placement.rotation.copy()

    def _step(self) -> None:
        if self.t_ns % CYCLE_NS == 0:
            self._linearise()
        self.t_ns += self._substep_ns
        dt = self._dt
        sx, sy, sz, hx, hy, hz, wx, wy, wz = (self._A @ self.qd).tolist()
        x, y, z = self._sole_at
        motion = Motion(x, y, z, sx, sy, sz)
        contact = self.terrain.step(dt, motion) if self.terrain else NO_CONTACT
        view = HandView((x, y, z), (sx, sy, sz), self._hand_at, (hx, hy, hz))
        push = self.hand.step(view)
        if not self._is_held:
            k, b = _GRIP if self.hand.is_holding else _NO_GRIP
            ex, ey, ez = self._tilt
            ux, uy, uz = self._up
            wrench = np.array(
                (
                    -contact.F_t,
                    contact.F_y,
                    contact.F_n,
                    push[0] + ux,
                    push[1] + uy,
                    push[2] + uz,
                    k * ex - b * wx,
                    k * ey - b * wy,
                    k * ez - b * wz,
                )
            )
            self._integrate(self._tau + self.disturbance + wrench @ self._A)
            px, py, pz = self._hand_at
            self._sole_at = (x + dt * sx, y + dt * sy, z + dt * sz)
            self._hand_at = (px + dt * hx, py + dt * hy, pz + dt * hz)
            self._tilt = (ex - dt * wx, ey - dt * wy, ez - dt * wz)
        self._account((x, y, z), (sx, sy, sz), contact, push)

    def _linearise(self) -> None:
        """Take positions and Jacobians anew, once per cycle.

        Within the 2 ms sole and hand move along them; the joints themselves and their
        dynamics are never linearised. Rows of A: sole, hand, turn of the hand, in the
        terrain frame.
        """
        model, data, R = self._model, self._data, self._R
        pin.computeJointJacobians(model, data, self.q)
        sole = pin.updateFramePlacement(model, data, self._sole)
        hand = pin.updateFramePlacement(model, data, self._hand)
        J_h = pin.getFrameJacobian(model, data, self._hand, _AXES)
        A = self._A
        A[:3] = R @ pin.getFrameJacobian(model, data, self._sole, _AXES)[:3]
        A[3:6] = R @ J_h[:3]
        A[6:] = R @ J_h[3:]
        x, y, z = (R @ (sole.translation - self._origin)).tolist()
        self._sole_at = (x, y, z)
        x, y, z = (R @ (hand.translation - self._origin)).tolist()
        self._hand_at = (x, y, z)
        E = self._wanted @ hand.rotation.T
        turn = (E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1])
        x, y, z = (0.5 * (R @ np.array(turn))).tolist()
        self._tilt = (x, y, z)

    def _integrate(self, tau: Array) -> None:
        """Advance joints by one substep under `tau` (without gravity), friction."""
        qd, dt, model = self.qd, self._dt, self._model
        speed = np.abs(qd) + _STANDSTILL
        D = self._coulomb * np.tanh(speed / _EPSILON) / speed + self._viscous
        model.armature = self._drive + dt * D
        tau = tau - D * qd
        if (np.abs(self.q - self._middle) > self._reach).any():
            tau += self._stops(qd)
        qdd = pin.aba(model, self._data, self.q, qd, tau)
        self.qd = qd + dt * qdd
        self.q = self.q + dt * self.qd

    def _stops(self, qd: Array) -> Array:
        beyond = np.minimum(self._constants.q_upper - self.q, 0.0) + np.maximum(
            self._constants.q_lower - self.q, 0.0
        )
        return _STOP_K * beyond - _STOP_B * qd * (beyond != 0.0)

    def _account(
        self,
        position: tuple[float, float, float],
        velocity: tuple[float, float, float],
        contact: Contact,
        push: tuple[float, float, float],
    ) -> None:
        self._sum_force += (-contact.F_t, contact.F_y, contact.F_n)
        self._parts += 1
        if self.t_ns % CYCLE_NS:
            return
        self._cycle_force = self._sum_force / self._parts
        self._sum_force = np.zeros(3)
        self._parts = 0
        v = np.array(velocity)
        self._cycle_a = (v - self._cycle_v) / (CYCLE_NS * 1e-9)
        self._cycle_v = v
        if self.truth is not None:
            along, across, normal = self._cycle_force.tolist()
            force = (-along, across, normal)
            row = (*self.q.tolist(), *position, *velocity, *force, *push)
            self.truth.add(self.t_ns, row)
