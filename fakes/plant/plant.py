"""The arm as a body: seven joints, foot on the ground, hand on the forearm.

`body` has the equations. Ground and dynamics go on in substeps. Once in a cycle of 2 ms
are taken anew: the Jacobians, the damping of the friction unless a motor is fast, and
the force of the hand, of 10 Hz at most.
"""

from collections.abc import Sequence
from math import floor, hypot

import numpy as np

from acquisition.clock import PERIOD_NS
from fakes.ground.terrain import Terrain
from fakes.plant.body import GRIP, NO_GRIP, ArmBody, HandLoad
from fakes.plant.cables import CableDrives
from fakes.plant.friction import draw_friction
from fakes.plant.gauges import Wrench, WristGauges
from fakes.plant.grip import Ends, JointGrip, PoseWay, Side, StopWay
from fakes.plant.hand import Hand
from fakes.plant.joints import JointDrives
from fakes.plant.model import (
    FOREARM_MASS,
    PlantOptions,
    Support,
    arm_and_hand,
    cable_inertia,
    motor_inertia,
    motor_weights,
)
from fakes.plant.push import Vector3
from fakes.plant.windings import shorted_damping
from fakes.plant.wiring import Wiring
from fakes.truth import Truth
from ft_sensor.payload import TerrainFrame
from wam.model.constants import GRAVITY, ArmConstants, Array
from wam.model.tool import Tool

_NO_TORQUE = (0.0,) * 7
_JOINT_7, _TWIST_RATE = 6, 2.0  # N m/s, of a person
_ON_STAND = 0.02  # rad, of each joint: the foot has not left the stand
# A person notices that the arm grows heavy, and then bears it [s].
_NOTICED, _BORNE = 0.2, 0.5
_STRONGEST = 150.0  # of a person [N]


class ArmPlant:
    """Implements fakes.pucks.bank.MotorSide with the dynamics of the whole arm.

    Attributes:
        disturbance: joint torques from outside [N m], shape (7,).
        terrain: the ground; None = the foot hangs above nothing.
        hand: the operator's.
        finger: force of a person who touches the foot, terrain frame [N].
        t_ns: how far the world has gone on [ns].
        truth: what really happened; None = not written down.
        friction: of the motors.
        support: what bears the arm while no motor drives it.
        wiring: what is wrong between pucks and motors; None = nothing is.
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
        forearm = FOREARM_MASS if options.has_hand else 0.0
        parts = arm_and_hand(constants, tool, frame, forearm, options.down)
        self._substeps = options.substeps
        self._substep_ns = PERIOD_NS // options.substeps
        weights = motor_weights(parts.model, constants, q)
        drawn = draw_friction(constants, options.friction, options.seed, weights)
        self.friction = drawn if options.motors is None else options.motors
        self._axes, self._down = frame.axes(), _unit(options.down)
        up = -self._axes.dot(self._down)
        self._up: list[float] = (up * forearm * GRAVITY).tolist()
        self.support = options.support
        self._stand = q.copy()
        self._is_held = self.support is not Support.NONE
        self._is_idle, self._is_pulled = True, False
        self._heavy_since_ns = -round(1e9 * _BORNE)
        self.terrain: Terrain | None = None
        self.hand = Hand(PERIOD_NS * 1e-9, is_there=options.has_hand)
        self.finger = (0.0, 0.0, 0.0)
        self._hung = 0.0  # on a string from the sole [kg]
        self._pushed: tuple[Array, int] = (np.zeros(3), 0)  # at the sole [N], until
        self._twist, self._twisted_until_ns = 0.0, 0  # about joint 7 [N m]
        self._twisted = 0.0  # of that, in this cycle
        self._pull: Vector3 | None = None  # at the sole beside the ground's [N]
        self._ends = Ends(constants.q_lower, constants.q_upper)
        self._has_links = False
        self.t_ns = 0
        self.truth: Truth | None = None
        self.wiring: Wiring | None = None
        # Mean wrench of the ground over a cycle.
        self._ground: Wrench = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._push = (0.0, 0.0, 0.0)  # force of the hand
        inertia = motor_inertia(parts.model, constants, q)
        dt = self._substep_ns * 1e-9
        windings = shorted_damping(options.windings, options.seed)
        if options.cables is None:
            drives = JointDrives(constants, self.friction, inertia, dt, windings)
        else:
            drives = CableDrives(
                constants,
                self.friction,
                inertia,
                cable_inertia(parts.model, constants, q),
                dt,
                windings,
                options.cables,
            )
        self._body = ArmBody(parts, drives, constants.j2mp, q, self._substep_ns)
        self.disturbance = self._body.disturbance
        self._wrist = WristGauges(tool, up, PERIOD_NS * 1e-9)
        self._wrist.end_cycle(self._body.rotation, self._ground, [0.0] * 6)
        self._body.hold(is_held=self._is_held)

    @property
    def q(self) -> Array:
        """Joint positions [rad], shape (7,); as they are now, also later."""
        return self._body.q

    @q.setter
    def q(self, q: Array) -> None:
        self._body.move(q)
        self._stand = q.copy()  # it is put there, its stand too

    def lay_cable(self, force: Sequence[float]) -> None:
        """Let the wrist sensor's cable pull at the foot, `force` [N] in base frame."""
        self._wrist.cable = self._axes.dot(np.array(force, dtype=np.float64))

    @property
    def ends(self) -> Ends:
        """Where the joints really end."""
        return self._ends

    @property
    def qd(self) -> Array:
        """Joint velocities [rad/s], shape (7,); as they are now, also later."""
        return self._body.qd

    # --- what the pucks see -------------------------------------------------------

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`, in whole substeps."""
        step_ns = self._substep_ns
        while (room_ns := t_ns - self.t_ns) >= step_ns:
            into_ns = self.t_ns % PERIOD_NS
            if into_ns == 0:
                self._begin_cycle()
            steps = min(room_ns, PERIOD_NS - into_ns) // step_ns
            self._body.go_on(steps, self.terrain)
            self.t_ns += steps * step_ns
            if self.t_ns % PERIOD_NS == 0:
                self._end_cycle()

    def counts(self) -> Sequence[int]:
        """Return encoder counts of the seven motors."""
        counts = self._body.counts()
        if self.wiring is not None:
            counts = self.wiring.told_of(np.array(counts)).tolist()
        return [floor(count) for count in counts]

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        if self.wiring is not None:
            units = self.wiring.made_of(units)
        self._body.drive(units)
        is_pulled = any(units)
        if is_pulled is not self._is_pulled:
            self._is_pulled = is_pulled
            self._lay_down()

    @property
    def is_idle(self) -> bool:
        """Whether all windings are shorted: the arm is damped, and sinks."""
        return self._is_idle

    @property
    def is_held(self) -> bool:
        """Whether a stand or a person bears an arm without torque: it stands still."""
        return self._is_held

    def short_windings(self, shorted: Sequence[bool]) -> None:
        """Short the windings of motors 1 to 7, which damps them, or open them."""
        if all(shorted) and not self._is_idle:
            self._heavy_since_ns = self.t_ns
        self._is_idle = all(shorted)
        self._body.drives.short(shorted)
        if self._is_idle:
            self._body.drive(_NO_TORQUE)
        self._lay_down()

    # --- what the sensor feels ----------------------------------------------------

    def sensor_load(self, t_ns: int) -> Wrench:
        """Return the load on the wrist sensor in its own frame [N, N m].

        Its mean over the cycle that ended last; the steps after that can wait.
        """
        self.advance(t_ns - t_ns % PERIOD_NS)
        return self._wrist.load()

    # --- the world ----------------------------------------------------------------

    @property
    def contact_force(self) -> tuple[float, float, float]:
        """Force of the ground on the foot in the terrain frame, mean of a cycle [N]."""
        x, y, z, _, _, _ = self._ground
        return x, y, z

    @property
    def foot_speed(self) -> float:
        """Speed of the sole [m/s]."""
        return float(np.linalg.norm(self._body.motion()[3:6]))

    def pose(self, q: Sequence[float], seconds: float) -> None:
        """Let two hands bring the joints to `q` [rad] in `seconds`, and hold them."""
        self._grip_links(JointGrip(PoseWay(q, seconds, self._ends)))

    def turn_to_stop(self, joint: int, side: Side) -> None:
        """Let two hands turn joint 1-7 until its stop bears; the others stay."""
        self._grip_links(JointGrip(StopWay(joint, side, self._ends)))

    @property
    def is_hand_done(self) -> bool:
        """Whether the hand has come to the end of its last order."""
        return self.hand.is_done

    def let_go(self) -> None:
        """Let the hands let go of the arm."""
        self.hand.let_go()

    def hang(self, mass: float) -> None:
        """Hang `mass` [kg] on a string from the centre of the sole; 0 = nothing."""
        self._hung = mass

    def push_with(self, force: Sequence[float], seconds: float) -> None:
        """Let a person push the sole with `force` [N], base frame, for `seconds`."""
        until_ns = self.t_ns + round(1e9 * seconds)
        self._pushed = self._axes.dot(np.array(force, dtype=np.float64)), until_ns

    def twist(self, torque: float, seconds: float) -> None:
        """Let a person twist the foot about joint 7, `torque` [N m], for `seconds`."""
        self._twist = torque
        self._twisted_until_ns = self.t_ns + round(1e9 * seconds)

    def start_truth(self) -> None:
        """Begin to write down what really happens."""
        self.truth = Truth()

    def take_truth(self) -> Truth:
        """Return what happened since `start_truth`; nothing more is written down."""
        taken, self.truth = self.truth or Truth(), None
        return taken

    def _grip_links(self, grip: JointGrip) -> None:
        self.hand.hold_links(grip)
        self._lay_down()

    def _lay_down(self) -> None:
        """Find out whether something bears the arm."""
        if self.hand.grip is not None:
            is_held = False
        elif self.support is Support.PERSON:
            is_held = self._is_idle or not self._is_pulled
        else:
            is_held = (
                self.support is Support.STAND
                and self._is_idle
                and float(np.abs(self.q - self._stand).max()) < _ON_STAND
            )
        if is_held is not self._is_held:
            self._is_held = is_held
            self._body.hold(is_held=is_held)

    def _begin_cycle(self) -> None:
        """Take anew what stays as it is for 2 ms."""
        if self._is_idle and not self._is_held:
            self._lay_down()
        body, links = self._body, self.hand.grip
        self._push = self.hand.step(body.linearise())
        if self._has_links and links is None:
            body.keep_turn()
        self._has_links = links is not None
        force, self._pull = self._lift(), self._pull_at_sole()
        twisted = 0.0
        if self.t_ns < self._twisted_until_ns:  # begun gently, let go at once
            step = _TWIST_RATE * PERIOD_NS * 1e-9
            most = self._twist - self._twisted
            twisted = self._twisted + min(max(most, -step), step)
        if twisted != self._twisted:
            self.disturbance[_JOINT_7] += twisted - self._twisted
            self._twisted = twisted
        grip = GRIP if self.hand.is_holding and links is None else NO_GRIP
        torques = None
        if links is not None:
            torques = links.step(self.q, body.bearing(force, self._pull))
        body.begin_cycle(HandLoad(force, grip, self._pull, torques), self.t_ns)

    def _pull_at_sole(self) -> Vector3 | None:
        """Return the force of what hangs there or pushes, terrain frame [N]."""
        pushed, until_ns = self._pushed
        is_pushed = self.t_ns < until_ns
        if not (self._hung or is_pushed):
            return None
        force = self._hung * GRAVITY * self._axes.dot(self._down)
        x, y, z = (force + pushed if is_pushed else force).tolist()
        return x, y, z

    def _lift(self) -> tuple[float, float, float]:
        """Return the force of the hand with what the person carries [N].

        That is the own forearm, and soon after it went idle the arm.
        """
        (x, y, z), (ux, uy, uz) = self._push, self._up
        is_borne = self._is_held or self.hand.grip is not None
        if self._is_idle and self.hand.is_holding and not is_borne:
            heavy = 1e-9 * (self.t_ns - self._heavy_since_ns)
            share = min(max((heavy - _NOTICED) / (_BORNE - _NOTICED), 0.0), 1.0)
            bx, by, bz = self._body.burden()
            share *= min(1.0, _STRONGEST / max(hypot(bx, by, bz), _STRONGEST))
            ux += share * (bx - ux)
            uy += share * (by - uy)
            uz += share * (bz - uz)
        return x + ux, y + uy, z + uz

    def _end_cycle(self) -> None:
        (x, y, z, tx, ty, tz), motion = self._body.end_cycle()
        n = self._substeps
        self._ground = x, y, z, tx, ty, tz = x / n, y / n, z / n, tx / n, ty / n, tz / n
        # The hand that holds the arm gives way to nothing that small.
        fx, fy, fz = self.finger
        if self._pull is not None:
            px, py, pz = self._pull
            fx, fy, fz = fx + px, fy + py, fz + pz
        if self._twisted:
            ux, uy, uz = (self._twisted * self._body.rotation[:, 2]).tolist()
            tx, ty, tz = tx + ux, ty + uy, tz + uz
        felt = (x + fx, y + fy, z + fz, tx, ty, tz)
        self._wrist.end_cycle(self._body.rotation, felt, motion[3:])
        if self.truth is not None:
            row = (*self.q.tolist(), *motion[:6], -x, y, z, *self._push)
            self.truth.add(self.t_ns, row)


def _unit(vector: Sequence[float]) -> Array:
    """Return `vector` with length one, shape (3,)."""
    return np.array(vector) / np.linalg.norm(vector)
