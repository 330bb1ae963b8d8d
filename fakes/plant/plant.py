# pyright: reportMissingImports=false
"""The arm as a body: seven joints, foot on the ground, hand on the forearm.

    (M + dt D) (qd' - qd) = dt (tau + J_s^T w_s + J_h^T w_h + T^T f - nle)
    q' = q + dt qd'

nle at q and qd + dt qdd / 2, M with drive inertia, w_s the ground's wrench at the sole,
w_h the hand's at the forearm, T the transmission, f the friction of the motors at qd.
D is the diagonal of the damping of friction and stops, which is an addition to the
armature, so one articulated-body pass solves it. What a differential adds beside the
diagonal is smaller and taken explicitly: steps stay stable.

Ground and dynamics go on in substeps. Once in a cycle of 2 ms are taken anew: the
Jacobians, D unless a motor is fast, and the force of the hand, of 10 Hz at most.
"""

from collections.abc import Sequence
from math import floor

import numpy as np
import pinocchio as pin

from acquisition import PERIOD_NS
from fakes.ground import NO_CONTACT, Terrain
from fakes.plant.cables import CableDrives
from fakes.plant.friction import draw_friction
from fakes.plant.gauges import Wrench, WristGauges
from fakes.plant.hand import Hand
from fakes.plant.joints import JointDrives, JointLoads, JointState
from fakes.plant.model import (
    FOREARM_MASS,
    PlantOptions,
    arm_and_hand,
    cable_inertia,
    motor_inertia,
    motor_weights,
)
from fakes.plant.push import HandView
from fakes.truth import Truth
from ft_sensor import TerrainFrame
from wam.model import GRAVITY, ArmConstants, Array, Tool

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_GRIP = (40.0, 1.0)  # the hand keeps the forearm's turn: N m/rad, N m s/rad
_NO_GRIP = (0.0, 0.0)
_NOTHING = (0.0,) * 6
_NO_TORQUE = (0.0,) * 7


class ArmPlant:
    """Implements fakes.pucks.bank.MotorSide with the dynamics of the whole arm.

    Attributes:
        disturbance: joint torques from outside [N m], shape (7,).
        terrain: the ground; None = the foot hangs above nothing.
        hand: the operator's.
        finger: force of a person who touches the foot, terrain frame [N].
        t_ns: how far the world has gone on [ns].
        truth: what really happened; None = not written down.
        friction, stops: of the motors, of the joints.
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
        forearm = FOREARM_MASS if options.has_hand else 0.0
        parts = arm_and_hand(constants, tool, frame, forearm)
        self._model, self._sole, self._hand = parts
        self._data = self._model.createData()
        self._wrist = WristGauges(tool, frame.axes()[:, 2], PERIOD_NS * 1e-9)
        self._substeps = options.substeps
        self._substep_ns = PERIOD_NS // options.substeps
        self._dt = self._substep_ns * 1e-9
        borne = motor_weights(self._model, constants, q)
        drawn = draw_friction(constants, options.friction, options.seed, borne)
        self.friction = drawn if options.rubbing is None else options.rubbing
        # Forces act at the beginning of each substep, on average here in a cycle [s].
        self._midway = np.array([1.0, 5e-10 * (PERIOD_NS - self._substep_ns), 0.0])
        up = frame.axes()[:, 2]
        self._up: list[float] = (up * forearm * GRAVITY).tolist()
        self._cables = options.cables
        self._is_held = True
        self.terrain: Terrain | None = None
        self.hand = Hand(PERIOD_NS * 1e-9, is_there=options.has_hand)
        self.finger = (0.0, 0.0, 0.0)
        self.t_ns = 0
        self.truth: Truth | None = None
        self._sum = _NOTHING  # of the ground's wrench over a cycle
        self._ground = [0.0] * 6  # its mean
        # Force of the hand, and with it the weight that the person carries.
        self._push = self._held = (0.0, 0.0, 0.0)
        self._joints = JointState(q, self._dt)
        self._prepare()

    def _prepare(self) -> None:
        """Lay out what every substep uses again; the hand keeps the turn of now."""
        pin.forwardKinematics(self._model, self._data, self.q)
        hand = pin.updateFramePlacement(self._model, self._data, self._hand)
        self._wanted = hand.rotation.copy()
        self._loads = JointLoads(self._constants.j2mp)
        self._linearise()
        self._drives = self._build_drives()
        self.disturbance, self.stops = self._drives.disturbance, self._drives.stops
        self._begin_drives()
        self._wrist.end_cycle(self._foot_rotation, self._ground, self._rates[:6])

    def _build_drives(self) -> JointDrives:
        model, constants, dt = self._model, self._constants, self._dt
        inertia = motor_inertia(model, constants, self.q)
        if self._cables is None:
            return JointDrives(constants, self.friction, inertia, dt)
        both = inertia, cable_inertia(model, constants, self.q)
        return CableDrives(constants, self.friction, both, dt, self._cables)

    @property
    def q(self) -> Array:
        """Joint positions [rad], shape (7,); as they are now, also later."""
        return self._joints.rows[0]

    @q.setter
    def q(self, q: Array) -> None:
        self._joints.move(q)

    @property
    def qd(self) -> Array:
        """Joint velocities [rad/s], shape (7,); as they are now, also later."""
        return self._joints.rows[1]

    # --- what the pucks see -------------------------------------------------------

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`, in whole substeps."""
        last_ns = t_ns - self._substep_ns
        while self.t_ns <= last_ns:
            self._step()

    def counts(self) -> Sequence[int]:
        """Return encoder counts of the seven motors."""
        return [floor(count) for count in self._drives.counts(self.q).tolist()]

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        self._drives.drive(units)

    @property
    def is_held(self) -> bool:
        """Whether the brakes hold the joints."""
        return self._is_held

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Hold the joints (braked), or let them follow torque or fall."""
        self._is_held = is_braked and is_powered
        if self._is_held:
            self._joints.rest(self.q)
            self._rates, self._speeds = [0.0] * 12, [0.0] * 7
            self._drives.rest()
        if is_braked or not is_powered:
            self._drives.drive(_NO_TORQUE)

    # --- what the sensor feels ----------------------------------------------------

    def sensor_load(self, t_ns: int) -> Wrench:
        """Return the load on the wrist sensor in its own frame [N, N m].

        Its mean over the cycle that ended last; the steps after that can wait.
        """
        self.advance(t_ns - t_ns % PERIOD_NS)
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
    def sole_x(self) -> float:
        """Way of the sole from the far end [m]."""
        return self._sole_at[0]

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
        if self.t_ns % PERIOD_NS == 0:
            self._begin_cycle()
        self.t_ns += self._substep_ns
        sx, sy, sz, fx, fy, fz, _, _, _, wx, wy, wz = self._rates
        contact = NO_CONTACT
        if self.terrain is not None:
            motion = (*self._sole_at, sx, sy, sz, fx, fy, fz)
            contact = self.terrain.step(self._dt, motion)
        F_t, F_y, F_n, M_x, M_y, M_z = contact
        a, b, c, d, e, f = self._sum
        self._sum = (a - F_t, b + F_y, c + F_n, d + M_x, e + M_y, f + M_z)
        if not self._is_held:
            k, b = _GRIP if self.hand.is_holding else _NO_GRIP
            ex, ey, ez = self._tilt
            turned = (k * ex - b * wx, k * ey - b * wy, k * ez - b * wz)
            self._integrate((-F_t, F_y, F_n, M_x, M_y, M_z, *self._held, *turned))
        if self.t_ns % PERIOD_NS == 0:
            self._end_cycle()

    def _begin_cycle(self) -> None:
        """Take anew what stays as it is for 2 ms."""
        self._linearise()
        rates, hand_at = self._rates, self._hand_at
        sx, sy, sz, _, _, _, hx, hy, hz = rates[:9]
        view = HandView(self._sole_at, (sx, sy, sz), hand_at, (hx, hy, hz))
        self._push = x, y, z = self.hand.step(view)
        ux, uy, uz = self._up
        self._held = (x + ux, y + uy, z + uz)
        self._begin_drives()

    def _begin_drives(self) -> None:
        self._drives.begin_cycle(self._joints.rows, self._speeds, self.t_ns)
        self._model.armature = self._drives.armature

    def _linearise(self) -> None:
        """Take positions and Jacobians anew, once per cycle.

        Within the 2 ms sole and hand move along them; the joints themselves and their
        dynamics are never linearised. Everything is in the terrain frame.
        """
        model, data, A = self._model, self._data, self._loads.A
        pin.forwardKinematics(model, data, self.q)
        sole = pin.updateFramePlacement(model, data, self._sole)
        hand = pin.updateFramePlacement(model, data, self._hand)
        self._foot_rotation = sole.rotation.copy()
        x, y, z = sole.translation.tolist()
        self._sole_at = (x, y, z)
        x, y, z = hand.translation.tolist()
        self._hand_at = (x, y, z)
        (_, xy, xz), (yx, _, yz), (zx, zy, _) = self._wanted.dot(
            hand.rotation.T
        ).tolist()
        self._tilt = (0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy))
        pin.computeJointJacobians(model, data, self._midway.dot(self._joints.rows))
        A[:6] = pin.getFrameJacobian(model, data, self._sole, _AXES)
        A[6:12] = pin.getFrameJacobian(model, data, self._hand, _AXES)
        rates = A.dot(self.qd).tolist()
        self._rates, self._speeds = rates[:12], rates[12:]

    def _integrate(self, wrench: tuple[float, ...]) -> None:
        """Advance by one substep under `wrench` on foot and hand, twelve numbers."""
        dt, state, drives = self._dt, self._joints.rows, self._drives
        armature = drives.armature
        against = drives.torques(state, self._speeds)
        if drives.armature is not armature:
            self._model.armature = drives.armature
        tau = self._loads.torques(wrench, against, drives.driving)
        qdd = pin.aba(self._model, self._data, state[0], state[2], tau)
        motion = self._loads.A.dot(self._joints.step(qdd)[1]).tolist()
        self._rates, self._speeds = rates, speeds = motion[:12], motion[12:]
        drives.follow(speeds)
        sx, sy, sz, _, _, _, _, _, _, wx, wy, wz = rates
        x, y, z = self._sole_at
        self._sole_at = (x + dt * sx, y + dt * sy, z + dt * sz)
        x, y, z = self._tilt
        self._tilt = (x - dt * wx, y - dt * wy, z - dt * wz)

    def _end_cycle(self) -> None:
        self._ground = ground = [total / self._substeps for total in self._sum]
        self._sum = _NOTHING
        # The hand that holds the arm gives way to nothing that small.
        fx, fy, fz = self.finger
        x, y, z, *moment = ground
        felt = (x + fx, y + fy, z + fz, *moment)
        self._wrist.end_cycle(self._foot_rotation, felt, self._rates[:6])
        if self.truth is not None:
            foot = (*self._sole_at, *self._rates[:3])
            row = (*self.q.tolist(), *foot, -x, y, z, *self._push)
            self.truth.add(self.t_ns, row)
