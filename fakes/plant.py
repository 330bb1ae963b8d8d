# pyright: reportMissingImports=false
"""The arm as a body: seven joints, foot on the ground, hand on the forearm.

    (M + dt D) qd' = M qd + dt (tau + J_s^T w_s + J_h^T w_h - nle),   q' = q + dt qd'

nle at q and qd + dt qdd / 2, M with drive inertia, D the resistance of the joints taken
implicitly, w_s the ground's wrench at the sole, w_h the hand's at the forearm. The
implicit part is an addition to the armature, so one articulated-body pass solves it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor

import numpy as np
import pinocchio as pin

from fakes.contact import NO_CONTACT, Motion
from fakes.hand import Hand
from fakes.joints import JointResistance
from fakes.push import HandView
from fakes.terrain import Terrain
from fakes.truth import Truth
from fakes.wrist import Wrench, Wrist
from ft_sensor.payload import TerrainFrame
from wam.constants import GRAVITY, ArmConstants, Array
from wam.model import add_point, build_pinocchio
from wam.tool import Tool

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
CYCLE_NS = 2_000_000
FOREARM_MASS = 1.0  # of the person's arm, carried by the person [kg]
_HAND_ABOVE_PLATE = 0.030  # on the axis of joint 7 [m]
_GRIP = (40.0, 1.0)  # the hand keeps the forearm's turn: N m/rad, N m s/rad
_NO_GRIP = (0.0, 0.0)
_NOTHING = (0.0,) * 6


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """How the simulated arm differs from an ideal one.

    Attributes:
        friction: share of the joint friction identified on another arm (1 = all of
            it). A real arm's is unknown; with 0.05 of it a fifth of the slips bounce
            back, with more than about 0.1 hardly any.
        substeps: steps per 2 ms cycle.
    """

    friction: float = 0.02
    substeps: int = 4


class ArmPlant:
    """Implements fakes.puck_bank.MotorSide with the dynamics of the whole arm.

    Attributes:
        q: joint positions [rad], shape (7,).
        qd: joint velocities [rad/s], shape (7,).
        disturbance: joint torques from outside [N m], shape (7,).
        terrain: the ground; None = the foot hangs above nothing.
        hand: the operator's.
        finger: force of somebody who touches the foot, terrain frame [N].
        t_ns: how far the world has gone on [ns].
        truth: what really happened; None = not written down.
    """

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
        self._model = model = build_pinocchio(constants, (tool.sensor, tool.foot))
        self._add_forearm(constants)
        self._sole = add_point(model, constants, "sole", tool.sole)
        self._data = model.createData()
        self._wrist = Wrist(tool, frame.axes(), CYCLE_NS * 1e-9)
        self._substeps = options.substeps
        self._substep_ns = CYCLE_NS // options.substeps
        self._dt = self._substep_ns * 1e-9
        self._resistance = JointResistance(constants, options.friction, self._dt)
        # Forces act at the beginning of each substep, on average here in a cycle [s].
        self._midway = 0.5 * (CYCLE_NS - self._substep_ns) * 1e-9
        self._R = frame.axes()
        self._R4 = np.kron(np.eye(4), self._R)
        self._origin = np.array(frame.far_end)
        self._up: list[float] = (self._R[:, 2] * FOREARM_MASS * GRAVITY).tolist()
        # counts of the encoders per joint angle, joint torque per puck unit
        turns = np.array(constants.cts) / (2.0 * np.pi)
        self._to_counts = turns[:, None] * constants.j2mp
        self._of_units = constants.j2mp.T / np.array(constants.ipnm, dtype=float)
        self._tau = np.zeros(7)
        self._is_held = True
        self.q, self.qd, self._qdd = q.copy(), np.zeros(7), np.zeros(7)
        self.disturbance = np.zeros(7)
        self.terrain: Terrain | None = None
        self.hand = Hand(self._dt)
        self.finger = (0.0, 0.0, 0.0)
        self.t_ns = 0
        self.truth: Truth | None = None
        self._sum = _NOTHING  # of the ground's wrench over a cycle
        self._ground = [0.0] * 6  # its mean
        self._push = (0.0, 0.0, 0.0)
        pin.computeJointJacobians(model, self._data, self.q)
        hand = pin.updateFramePlacement(model, self._data, self._hand)
        self._wanted = hand.rotation.copy()
        # Rows: sole's velocity, foot's turn, hand's velocity, hand's turn; the joints.
        self._B = np.vstack((np.zeros((12, 7)), np.eye(7)))
        self._A = self._B[:12]
        self._rates = [0.0] * 12
        self._linearise()
        self._wrist.end_cycle(self._foot_rotation, self._ground, self._rates[:6])

    def _add_forearm(self, constants: ArmConstants) -> None:
        """Add the hand's frame on link 6 and the mass of a forearm in it."""
        model = self._model
        alpha, height = constants.alpha[5], constants.d[6] - _HAND_ABOVE_PLATE
        c, s = np.cos(alpha), np.sin(alpha)
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        link = pin.SE3(tilt, np.array([constants.a[5], 0.0, constants.d[5]]))
        placement = link * pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        frame = pin.Frame("hand", 6, 0, placement, pin.FrameType.OP_FRAME)
        self._hand = model.addFrame(frame)
        arm = pin.Inertia(FOREARM_MASS, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(6, placement.act(arm), pin.SE3.Identity())

    # --- what the pucks see -------------------------------------------------------

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`, in whole substeps."""
        while self.t_ns + self._substep_ns <= t_ns:
            self._step()

    def counts(self) -> Sequence[int]:
        """Return encoder counts of the seven motors."""
        return [floor(count) for count in self._to_counts.dot(self.q).tolist()]

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        self._tau = self._of_units.dot(units)

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Hold the joints (braked), or let them follow torque or fall."""
        self._is_held = is_braked and is_powered
        if self._is_held:
            self.qd, self._qdd = np.zeros(7), np.zeros(7)
            self._rates = [0.0] * 12
        if is_braked or not is_powered:
            self._tau = np.zeros(7)

    # --- what the sensor feels ----------------------------------------------------

    def sensor_load(self, t_ns: int) -> Wrench:
        """Return the load on the wrist sensor in its own frame [N, N m].

        Its mean over the cycle that ended last.
        """
        self.advance(t_ns)
        return self._wrist.load()

    # --- the world ----------------------------------------------------------------

    @property
    def is_touching(self) -> bool:
        """Whether the ground carries anything."""
        return self._ground[2] > 0.05

    @property
    def contact_force(self) -> tuple[float, float, float]:
        """Force of the ground on the foot in the terrain frame, mean of a cycle [N]."""
        x, y, z = self._ground[:3]
        return x, y, z

    @property
    def foot_speed(self) -> float:
        """Speed of the sole [m/s]."""
        return float(np.linalg.norm(self._rates[:3]))

    def start_truth(self) -> None:
        """Begin to write down what really happens."""
        self.truth = Truth()

    def take_truth(self) -> Truth:
        """Return what happened since `start_truth`; nothing more is written down."""
        taken, self.truth = self.truth or Truth(), None
        return taken

    def _step(self) -> None:
        if self.t_ns % CYCLE_NS == 0:
            self._linearise()
        self.t_ns += self._substep_ns
        sx, sy, sz, fx, fy, fz, hx, hy, hz, wx, wy, wz = self._rates
        x, y, z = self._sole_at
        contact = NO_CONTACT
        if self.terrain is not None:
            motion = Motion(x, y, z, sx, sy, sz, fx, fy, fz)
            contact = self.terrain.step(self._dt, motion)
        view = HandView((x, y, z), (sx, sy, sz), self._hand_at, (hx, hy, hz))
        self._push = push = self.hand.step(view)
        F_t, F_y, F_n, M_x, M_y, M_z = contact
        a, b, c, d, e, f = self._sum
        self._sum = (a - F_t, b + F_y, c + F_n, d + M_x, e + M_y, f + M_z)
        if not self._is_held:
            k, b = _GRIP if self.hand.is_holding else _NO_GRIP
            ux, uy, uz = self._up
            ex, ey, ez = self._tilt
            ground = (-F_t, F_y, F_n, M_x, M_y, M_z)
            held = (push[0] + ux, push[1] + uy, push[2] + uz)
            turned = (k * ex - b * wx, k * ey - b * wy, k * ez - b * wz)
            self._integrate((*ground, *held, *turned))
        if self.t_ns % CYCLE_NS == 0:
            self._end_cycle()

    def _linearise(self) -> None:
        """Take positions and Jacobians anew, once per cycle.

        Within the 2 ms sole and hand move along them; the joints themselves and their
        dynamics are never linearised. Everything is in the terrain frame.
        """
        model, data, R, A = self._model, self._data, self._R, self._A
        pin.computeJointJacobians(model, data, self.q)
        sole = pin.updateFramePlacement(model, data, self._sole)
        hand = pin.updateFramePlacement(model, data, self._hand)
        self._foot_rotation = sole.rotation.copy()
        sole_at, hand_at = sole.translation.copy(), hand.translation.copy()
        E = self._wanted @ hand.rotation.T
        pin.computeJointJacobians(model, data, self.q + self._midway * self.qd)
        pin.updateFramePlacement(model, data, self._sole)
        pin.updateFramePlacement(model, data, self._hand)
        J_s = pin.getFrameJacobian(model, data, self._sole, _AXES)
        J_h = pin.getFrameJacobian(model, data, self._hand, _AXES)
        np.dot(self._R4, np.concatenate((J_s, J_h)), out=A)
        self._rates = A.dot(self.qd).tolist()
        x, y, z = R.dot(sole_at - self._origin).tolist()
        self._sole_at = (x, y, z)
        x, y, z = R.dot(hand_at - self._origin).tolist()
        self._hand_at = (x, y, z)
        turn = (E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1])
        x, y, z = R.dot(turn).tolist()
        self._tilt = (0.5 * x, 0.5 * y, 0.5 * z)

    def _integrate(self, wrench: tuple[float, ...]) -> None:
        """Advance by one substep under `wrench` on foot and hand, twelve numbers."""
        q, qd, dt, model = self.q, self.qd, self._dt, self._model
        inertias, resistance = self._resistance.at(q.tolist(), qd.tolist())
        model.armature = np.array(inertias)
        from_outside = np.array((*wrench, *resistance)).dot(self._B)
        tau = self._tau + self.disturbance + from_outside
        # Velocities stand half a step behind positions; the speed-dependent part of
        # the dynamics takes them where the positions are, or a free swing loses energy.
        now = qd + 0.5 * dt * self._qdd
        self._qdd = qdd = pin.aba(model, self._data, q, now, tau)
        self.qd = qd + dt * qdd
        self.q = q + dt * self.qd
        self._rates = rates = self._A.dot(self.qd).tolist()
        sx, sy, sz, _, _, _, hx, hy, hz, wx, wy, wz = rates
        x, y, z = self._sole_at
        self._sole_at = (x + dt * sx, y + dt * sy, z + dt * sz)
        x, y, z = self._hand_at
        self._hand_at = (x + dt * hx, y + dt * hy, z + dt * hz)
        x, y, z = self._tilt
        self._tilt = (x - dt * wx, y - dt * wy, z - dt * wz)

    def _end_cycle(self) -> None:
        self._ground = ground = [total / self._substeps for total in self._sum]
        self._sum = _NOTHING
        # The hand that holds the arm gives way to nothing that small.
        felt = [force + more for force, more in zip(ground, self.finger, strict=False)]
        felt += ground[3:]
        self._wrist.end_cycle(self._foot_rotation, felt, self._rates[:6])
        if self.truth is not None:
            force = (-ground[0], ground[1], ground[2])
            foot = (*self._sole_at, *self._rates[:3])
            self.truth.add(self.t_ns, (*self.q.tolist(), *foot, *force, *self._push))
