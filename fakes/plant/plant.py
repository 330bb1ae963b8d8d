# pyright: reportMissingImports=false
"""The arm as a body: seven joints, foot on the ground, hand on the forearm.

    (M + dt D) qd' = M qd + dt (tau + J_s^T w_s + J_h^T w_h - nle),   q' = q + dt qd'

nle at q and qd + dt qdd / 2, M with drive inertia, D the resistance of the joints taken
implicitly, w_s the ground's wrench at the sole, w_h the hand's at the forearm. The
implicit part is an addition to the armature, so one articulated-body pass solves it.

Ground and dynamics go on in substeps. What changes more slowly is taken anew once in a
cycle of 2 ms: the Jacobians, D, and the force of the hand, which has 10 Hz at most.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor

import numpy as np
import pinocchio as pin

from acquisition import PERIOD_NS
from fakes.ground import NO_CONTACT, Terrain
from fakes.plant.gauges import Wrench, WristGauges
from fakes.plant.hand import Hand
from fakes.plant.joints import JointLoads, JointResistance, JointState
from fakes.plant.model import FOREARM_MASS, arm_and_hand
from fakes.plant.push import HandView
from fakes.truth import Truth
from ft_sensor import TerrainFrame
from wam.model import GRAVITY, ArmConstants, Array, Tool

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_GRIP = (40.0, 1.0)  # the hand keeps the forearm's turn: N m/rad, N m s/rad
_NO_GRIP = (0.0, 0.0)
_NOTHING = (0.0,) * 6


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """How the simulated arm differs from an ideal one.

    Attributes:
        friction: share of the joint friction identified on another arm. A real arm's
            is unknown; with 0.05 a fifth of the slips bounce back, with 0.1 hardly any.
        substeps: steps per 2 ms cycle.
        has_hand: a person holds the arm by its forearm, from the beginning.
    """

    friction: float = 0.02
    substeps: int = 4
    has_hand: bool = True


class ArmPlant:
    """Implements fakes.pucks.bank.MotorSide with the dynamics of the whole arm.

    Attributes:
        disturbance: joint torques from outside [N m], shape (7,).
        terrain: the ground; None = the foot hangs above nothing.
        hand: the operator's.
        finger: force of a person who touches the foot, terrain frame [N].
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
        forearm = FOREARM_MASS if options.has_hand else 0.0
        parts = arm_and_hand(constants, tool, frame, forearm)
        self._model, self._sole, self._hand = parts
        self._data = self._model.createData()
        self._wrist = WristGauges(tool, frame.axes()[:, 2], PERIOD_NS * 1e-9)
        self._substeps = options.substeps
        self._substep_ns = PERIOD_NS // options.substeps
        self._dt = self._substep_ns * 1e-9
        self.resistance = JointResistance(constants, options.friction, self._dt)
        # Forces act at the beginning of each substep, on average here [s].
        self._midway = np.array([1.0, 5e-10 * (PERIOD_NS - self._substep_ns), 0.0])
        up = frame.axes()[:, 2]
        self._up: list[float] = (up * forearm * GRAVITY).tolist()
        # counts of the encoders per joint angle, joint torque per puck unit
        turns = np.array(constants.cts) / (2.0 * np.pi)
        self._to_counts = turns[:, None] * constants.j2mp
        self._of_units = constants.j2mp.T / np.array(constants.ipnm, dtype=float)
        self._tau = np.zeros(7)
        self._stops = np.zeros(7)
        self._driving = [0.0] * 7
        self._is_held = True
        self.disturbance = np.zeros(7)
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
        self._loads = JointLoads()
        self._rates = [0.0] * 12
        self._linearise()
        self._resist(*self._joints.rows[:2].tolist())
        self._wrist.end_cycle(self._foot_rotation, self._ground, self._rates[:6])

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
        return [floor(count) for count in self._to_counts.dot(self.q).tolist()]

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        self._tau = self._of_units.dot(units)
        self._drive()

    @property
    def is_held(self) -> bool:
        """Whether the brakes hold the joints."""
        return self._is_held

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Hold the joints (braked), or let them follow torque or fall."""
        self._is_held = is_braked and is_powered
        if self._is_held:
            self._joints.rest(self.q)
            self._rates = [0.0] * 12
        if is_braked or not is_powered:
            self._tau = np.zeros(7)
            self._drive()

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
            ground = (-F_t, F_y, F_n, M_x, M_y, M_z)
            turned = (k * ex - b * wx, k * ey - b * wy, k * ez - b * wz)
            self._integrate((*ground, *self._held, *turned))
        if self.t_ns % PERIOD_NS == 0:
            self._end_cycle()

    def _begin_cycle(self) -> None:
        """Take anew what stays as it is for 2 ms."""
        self._linearise()
        rates, hand_at = self._rates, self._hand_at
        sx, sy, sz, _, _, _, hx, hy, hz, _, _, _ = rates
        view = HandView(self._sole_at, (sx, sy, sz), hand_at, (hx, hy, hz))
        self._push = x, y, z = self.hand.step(view)
        ux, uy, uz = self._up
        self._held = (x + ux, y + uy, z + uz)
        self._resist(*self._joints.rows[:2].tolist())

    def _resist(self, q: list[float], qd: list[float]) -> None:
        """Take friction and stops as they are at `q` [rad] and `qd` [rad/s]."""
        now = self.resistance.at(q, qd)
        self._model.armature = np.array(now.inertias)
        self._loads.resist(now.damping)
        self._stops = np.array(now.springs)
        self._is_near_stop = now.is_near_stop
        self._drive()

    def _drive(self) -> None:
        """Add up what drives the joints, whatever they do in a substep."""
        self._driving = (self._tau + self.disturbance + self._stops).tolist()

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
        pin.updateFramePlacement(model, data, self._sole)
        pin.updateFramePlacement(model, data, self._hand)
        A[:6] = pin.getFrameJacobian(model, data, self._sole, _AXES)
        A[6:] = pin.getFrameJacobian(model, data, self._hand, _AXES)
        self._rates = A.dot(self.qd).tolist()

    def _integrate(self, wrench: tuple[float, ...]) -> None:
        """Advance by one substep under `wrench` on foot and hand, twelve numbers."""
        dt, state = self._dt, self._joints.rows
        if self._is_near_stop:
            self._resist(*state[:2].tolist())
        tau = self._loads.torques(wrench, state[1].tolist(), self._driving)
        qdd = pin.aba(self._model, self._data, state[0], state[2], tau)
        self._rates = rates = self._loads.A.dot(self._joints.step(qdd)[1]).tolist()
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
