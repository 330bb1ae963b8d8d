"""The simulated arm: seven joints, foot on the ground, hand on the forearm.

`body` has the equations. Ground and dynamics advance in substeps. Once per 2 ms cycle
are refreshed: Jacobians, damping of the friction (unless a motor is fast), and the
force of the hand, whose bandwidth is 10 Hz.
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
from fakes.plant.grip import JointGrip, PosePath, Side, StopAngles, StopPath
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
_JOINT_7, _TWIST_RATE = 6, 2.0  # index; N m/s of a person
_ON_STAND = 0.02  # rad of each joint within which the foot is on its stand
# Time until a person notices a heavy arm, and until it is fully supported [s].
_NOTICED, _BORNE = 0.2, 0.5
_STRONGEST = 150.0  # strength of a person [N]


class ArmPlant:
    """Dynamics of the whole arm; implements fakes.pucks.bank.MotorSide.

    Attributes:
        disturbance: external joint torques [N m], shape (7,).
        terrain: ground; None = no ground.
        hand: the operator's hand.
        finger: force of a person who touches the foot, terrain frame [N].
        t_ns: time of the world [ns].
        truth: ground truth; None = not recorded.
        friction: friction of the motors.
        support: support of the arm without motor torques.
        wiring: wrong wiring between pucks and motors; None = correct.
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
        self._axes, self._down = frame.axes(), _unit_vector(options.down)
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
        self._hung = 0.0  # mass on a string from the sole [kg]
        self._pushed: tuple[Array, int] = (np.zeros(3), 0)  # force at the sole [N], end
        self._twist, self._twisted_until_ns = 0.0, 0  # torque about joint 7 [N m], end
        self._twisted = 0.0  # present torque, ramped [N m]
        self._pull: Vector3 | None = None  # external force at the sole [N]
        self._ends = StopAngles(constants.q_lower, constants.q_upper)
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
        """Joint positions [rad], shape (7,); the array is not changed later."""
        return self._body.q

    @q.setter
    def q(self, q: Array) -> None:
        self._body.move(q)
        self._stand = q.copy()  # the stand moves along

    def lay_cable(self, force: Sequence[float]) -> None:
        """Set the force of the wrist sensor's cable on the foot [N], base frame."""
        self._wrist.cable = self._axes.dot(np.array(force, dtype=np.float64))

    @property
    def ends(self) -> StopAngles:
        """True joint stops."""
        return self._ends

    @property
    def qd(self) -> Array:
        """Joint velocities [rad/s], shape (7,); the array is not changed later."""
        return self._body.qd

    # --- interface to the pucks -------------------------------------------------------

    def advance(self, t_ns: int) -> None:
        """Advance the world to `t_ns` in whole substeps."""
        step_ns = self._substep_ns
        while (room_ns := t_ns - self.t_ns) >= step_ns:
            into_ns = self.t_ns % PERIOD_NS
            if into_ns == 0:
                self._begin_cycle()
            steps = min(room_ns, PERIOD_NS - into_ns) // step_ns
            self._body.advance(steps, self.terrain)
            self.t_ns += steps * step_ns
            if self.t_ns % PERIOD_NS == 0:
                self._end_cycle()

    def counts(self) -> Sequence[int]:
        """Return encoder counts of the seven motors."""
        counts = self._body.counts()
        if self.wiring is not None:
            counts = self.wiring.reported_counts(np.array(counts)).tolist()
        return [floor(count) for count in counts]

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units] to motors 1 to 7 from now on."""
        if self.wiring is not None:
            units = self.wiring.applied_torques(units)
        self._body.drive(units)
        is_pulled = any(units)
        if is_pulled is not self._is_pulled:
            self._is_pulled = is_pulled
            self._update_support()

    @property
    def is_idle(self) -> bool:
        """Whether all windings are shorted: the arm is damped and sinks."""
        return self._is_idle

    @property
    def is_held(self) -> bool:
        """Whether a stand or a person supports the arm: it is at rest."""
        return self._is_held

    def short_windings(self, shorted: Sequence[bool]) -> None:
        """Short (which damps) or open the windings of motors 1 to 7."""
        if all(shorted) and not self._is_idle:
            self._heavy_since_ns = self.t_ns
        self._is_idle = all(shorted)
        self._body.drives.short(shorted)
        if self._is_idle:
            self._body.drive(_NO_TORQUE)
        self._update_support()

    # --- interface to the sensor ----------------------------------------------------

    def sensor_load(self, t_ns: int) -> Wrench:
        """Return the load on the wrist sensor in its own frame [N, N m].

        The mean over the last complete cycle.
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
        """Bring the joints to `q` [rad] in `seconds` with two hands and hold them."""
        self._grip_links(JointGrip(PosePath(q, seconds, self._ends)))

    def turn_to_stop(self, joint: int, side: Side) -> None:
        """Turn joint 1-7 against its stop with two hands; hold the others in place."""
        self._grip_links(JointGrip(StopPath(joint, side, self._ends)))

    @property
    def is_hand_done(self) -> bool:
        """Whether the hand has finished its last action."""
        return self.hand.is_done

    def let_go(self) -> None:
        """Release the arm."""
        self.hand.let_go()

    def hang(self, mass: float) -> None:
        """Hang `mass` [kg] on a string from the centre of the sole; 0 removes it."""
        self._hung = mass

    def push_with(self, force: Sequence[float], seconds: float) -> None:
        """Push the sole with `force` [N], base frame, for `seconds`."""
        until_ns = self.t_ns + round(1e9 * seconds)
        self._pushed = self._axes.dot(np.array(force, dtype=np.float64)), until_ns

    def twist(self, torque: float, seconds: float) -> None:
        """Twist the foot about joint 7 with `torque` [N m] for `seconds`."""
        self._twist = torque
        self._twisted_until_ns = self.t_ns + round(1e9 * seconds)

    def start_truth(self) -> None:
        """Begin to record the ground truth."""
        self.truth = Truth()

    def take_truth(self) -> Truth:
        """Stop recording and return the ground truth since `start_truth`."""
        taken, self.truth = self.truth or Truth(), None
        return taken

    def _grip_links(self, grip: JointGrip) -> None:
        self.hand.hold_links(grip)
        self._update_support()

    def _update_support(self) -> None:
        """Update whether the arm is supported."""
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
        """Refresh the quantities held constant during one cycle."""
        if self._is_idle and not self._is_held:
            self._update_support()
        body, links = self._body, self.hand.grip
        self._push = self.hand.step(body.linearise())
        if self._has_links and links is None:
            body.hold_orientation()
        self._has_links = links is not None
        force, self._pull = self._lift(), self._pull_at_sole()
        twisted = 0.0
        if self.t_ns < self._twisted_until_ns:  # ramped up, ended at once
            step = _TWIST_RATE * PERIOD_NS * 1e-9
            remaining = self._twist - self._twisted
            twisted = self._twisted + min(max(remaining, -step), step)
        if twisted != self._twisted:
            self.disturbance[_JOINT_7] += twisted - self._twisted
            self._twisted = twisted
        grip = GRIP if self.hand.is_holding and links is None else NO_GRIP
        torques = None
        if links is not None:
            torques = links.step(self.q, body.unsupported_torques(force, self._pull))
        body.begin_cycle(HandLoad(force, grip, self._pull, torques), self.t_ns)

    def _pull_at_sole(self) -> Vector3 | None:
        """Return the force of hung mass and push at the sole, terrain frame [N]."""
        pushed, until_ns = self._pushed
        is_pushed = self.t_ns < until_ns
        if not (self._hung or is_pushed):
            return None
        force = self._hung * GRAVITY * self._axes.dot(self._down)
        x, y, z = (force + pushed if is_pushed else force).tolist()
        return x, y, z

    def _lift(self) -> tuple[float, float, float]:
        """Return the force of the hand including supported weight [N].

        The weight of the forearm and, soon after the arm went idle, of the arm.
        """
        (x, y, z), (ux, uy, uz) = self._push, self._up
        is_borne = self._is_held or self.hand.grip is not None
        if self._is_idle and self.hand.is_holding and not is_borne:
            heavy = 1e-9 * (self.t_ns - self._heavy_since_ns)
            share = min(max((heavy - _NOTICED) / (_BORNE - _NOTICED), 0.0), 1.0)
            bx, by, bz = self._body.carried_force()
            share *= min(1.0, _STRONGEST / max(hypot(bx, by, bz), _STRONGEST))
            ux += share * (bx - ux)
            uy += share * (by - uy)
            uz += share * (bz - uz)
        return x + ux, y + uy, z + uz

    def _end_cycle(self) -> None:
        (x, y, z, tx, ty, tz), motion = self._body.end_cycle()
        n = self._substeps
        self._ground = x, y, z, tx, ty, tz = x / n, y / n, z / n, tx / n, ty / n, tz / n
        # Finger, pull and twist act on the sensor; they are too small to move the arm.
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


def _unit_vector(vector: Sequence[float]) -> Array:
    """Return the unit vector along `vector`, shape (3,)."""
    return np.array(vector) / np.linalg.norm(vector)
