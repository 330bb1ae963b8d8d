"""Position control of joints: springs that hold an arm where it is, PD along a move."""

from dataclasses import dataclass

import numpy as np

from acquisition.devices import ArmReading
from wam.control.joint_lock import RAMP
from wam.model.constants import ArmConstants, Array

# Shares of the vendor's gains of joint PD, which are made to follow moves: softer, and
# damped the more the heavier the joint is. In no pose a swing of the arm is damped by
# less than 0.29 of critical, its drives without friction, and all of it stays stable at
# twice both gains: tests/wam/control/test_hold_stability.py.
_STIFFNESS = np.array([0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0])
_DAMPING = np.array([4.0, 3.0, 1.5, 3.0, 2.0, 2.0, 0.0])
# In guide the springs have this share of it, and the dampers the vendor's gains: a hand
# carries the arm (joint 2 with 9 N at 0.7 m), and left alone it stands still.
GUIDE_SHARE = 0.5
_SLOW = 0.05  # rad/s
# Of the springs, joints 1 to 7; the lock holds joint 7. At joint 2 it is three times
# the 4 N m that a foot of 0.6 kg forgotten in rig.toml weighs, and a person who moves
# the arm away at 0.7 m needs 17 N.
TORQUE_LIMIT = np.array([8.0, 12.0, 6.0, 6.0, 1.0, 1.0, 0.0])  # N m


class PositionHold:
    """Springs and dampers of joints 1 to 6.

        tau = clip(k (q_ref - q), -limit, limit) - d qd

    The reference follows a joint that goes further than limit / k from it (10 to 40
    mrad): a moving arm is braked by `limit` and the damper. A spring drives no joint
    faster than 0.05 rad/s: beyond, the reference follows it, too. So an arm that is
    pushed away stays where it is left, and one that was stopped does not swing back.

    Attributes:
        stiffness: of the springs [N m/rad], shape (7,).
        damping: of the dampers [N m s/rad], shape (7,).
        guide_damping: of those of a guided arm [N m s/rad], shape (7,).
    """

    def __init__(self, constants: ArmConstants) -> None:
        self.stiffness = _STIFFNESS * constants.kp
        self.damping = _DAMPING * constants.kd
        self.guide_damping = np.sign(_DAMPING) * constants.kd
        # What a spring reaches; and in plain numbers, which is faster in every cycle.
        self._reach = TORQUE_LIMIT / np.maximum(self.stiffness, 1.0)
        self._springs: list[tuple[float, float]] = list(
            zip(self.stiffness.tolist(), self._reach.tolist(), strict=True)
        )
        self._reference: list[float] | None = None

    def begin(self, q: Array, spring: Array | None = None) -> None:
        """Hold where the joints are; arms that are held stay where they are held.

        Args:
            q: joint positions [rad], shape (7,).
            spring: torques that the springs give at first [N m], shape (7,); None = 0.
        """
        if self._reference is not None:
            return
        reference = q
        if spring is not None:
            error = spring / np.maximum(self.stiffness, 1.0)
            reference = q + np.clip(error, -self._reach, self._reach)
        self._reference = reference.tolist()

    def release(self) -> None:
        """Let the joints go."""
        self._reference = None

    def spring(self, reading: ArmReading, share: float = 1.0) -> Array:
        """Return the torques of the springs alone [N m], shape (7,).

        They have `share` of their largest torques.
        """
        if self._reference is None:
            return np.zeros(7)
        held, torques = list[float](), list[float]()
        q, qd = reading.q.tolist(), reading.qd.tolist()
        rows = zip(self._reference, q, qd, self._springs, strict=True)
        for reference, angle, rate, (stiffness, reach) in rows:
            error = min(max(reference - angle, -share * reach), share * reach)
            if error * rate > 0.0 and not -_SLOW <= rate <= _SLOW:
                error = 0.0
            held.append(angle + error)
            torques.append(stiffness * error)
        if reading.is_complete:  # an extrapolated position drags no reference along
            self._reference = held
        return np.array(torques)

    def torque(self, reading: ArmReading, *, is_guided: bool = False) -> Array:
        """Return the torques that keep joints 1 to 6 where they are [N m], (7,).

        A guided arm is kept with half of them only, and damped less.
        """
        if is_guided:
            spring = self.spring(reading, GUIDE_SHARE)
            return spring - self.guide_damping * reading.qd
        return self.spring(reading) - self.damping * reading.qd


TOP_SPEED = 0.5  # rad/s
ACCELERATION = 0.5  # rad/s^2
# Of joint 7: soon at its speed, and with little overshoot of its stiff, light axis.
TURN_ACCELERATION = 6.0  # rad/s^2
PD_TORQUE_LIMIT = np.array([25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0])  # N m, PD part only


@dataclass(frozen=True, slots=True)
class JointMove:
    """A move from `start` to `goal` [rad], shapes (7,).

    The joint that has furthest to go moves with the trapezoid; the others follow in
    proportion, so the line is straight.
    """

    start: Array
    goal: Array
    speed: float = TOP_SPEED
    acceleration: float = ACCELERATION

    @property
    def duration(self) -> float:
        """Time from rest to rest [s]."""
        length = self._length
        if length * self.acceleration < self.speed**2:  # the speed is never reached
            return 2.0 * float(np.sqrt(length / self.acceleration))
        return length / self.speed + self.speed / self.acceleration

    def at(self, t: float) -> tuple[Array, Array]:
        """Return (positions [rad], velocities [rad/s]) `t` seconds after the start."""
        length, T, a = self._length, self.duration, self.acceleration
        if length == 0.0 or t >= T:
            return self.goal.copy(), np.zeros_like(self.goal)
        ramp = min(self.speed / a, T / 2.0)
        if t <= 0.0:
            s, v = 0.0, 0.0
        elif t < ramp:
            s, v = 0.5 * a * t * t, a * t
        elif t <= T - ramp:
            s, v = a * ramp * (t - 0.5 * ramp), a * ramp
        else:
            left = T - t
            s, v = length - 0.5 * a * left * left, a * left
        direction = (self.goal - self.start) / length
        return self.start + s * direction, v * direction

    @property
    def _length(self) -> float:
        return float(np.abs(self.goal - self.start).max())


def move_reference(move: JointMove, t: float) -> tuple[Array, Array]:
    """Return (positions [rad], velocities [rad/s]) that are wanted, shapes (7,).

    Joint 7 turns at its own pace as soon as its lock has let go: light as it is, it
    would be thrown by a torque that grows slowly while its encoder stands still. It
    turns the foot about its own axis, so the way is as free as on a straight line.

    Args:
        move: of the joints.
        t: time since its start [s].
    """
    q, qd = move.at(t)
    turn = JointMove(move.start[6:], move.goal[6:], TOP_SPEED, TURN_ACCELERATION)
    q[6:], qd[6:] = turn.at(t - RAMP)
    return q, qd


def joint_pd(kp: Array, kd: Array, error: Array, rate_error: Array) -> Array:
    """Return kp e + kd de [N m], shape (7,), clipped to the limits of the PD part."""
    return np.clip(kp * error + kd * rate_error, -PD_TORQUE_LIMIT, PD_TORQUE_LIMIT)


# N m beyond the weight that move a joint for certain: one and a half times the dry
# friction that was identified on another arm, and a quarter of the joint's weight;
# joint 1, which bears none, a tenth for the joints that swing it as they start.
BREAKAWAY = np.array([4.4, 9.0, 4.5, 3.5, 0.7, 0.7, 0.16])
# rad at the joint that a move goes on meanwhile, a fifth of what dry friction holds.
_IN_VAIN = np.array([1.0, 0.5, 0.5, 0.5, 2.0, 2.0, 3.0]) * 1e-3
_TREMBLE = 1  # counts by which an encoder at rest flickers


class MotorWatch:
    """Notices the motor that a move turns in vain.

    Its position stays while the move goes on, and its torque would move it whatever
    the friction: the encoder stands still, or something holds the joint. A motor whose
    encoder stands still is pulled faster and faster, so it has to be noticed before
    the joint seems to be far off.
    """

    def __init__(self, constants: ArmConstants) -> None:
        self._j2mp = np.array(constants.j2mp)
        self._of_torques = np.linalg.inv(self._j2mp).T
        self._breakaway: list[float] = (np.abs(self._of_torques) @ BREAKAWAY).tolist()
        self._in_vain: list[float] = (np.abs(self._j2mp) @ _IN_VAIN).tolist()
        self.begin()

    def begin(self) -> None:
        """Forget what was seen: a move begins."""
        self._counts: list[int] = []
        self._wanted: list[float] = []

    def stuck_motor(self, wanted: Array, excess: Array, reading: ArmReading) -> int:
        """Return the first motor that is turned in vain, 1-7; 0 = none.

        Args:
            wanted: where the move wants the joints [rad], shape (7,).
            excess: torques beyond the weight that it asks for [N m], shape (7,).
            reading: of this cycle.
        """
        angles = (self._j2mp @ wanted).tolist()
        if not self._counts:
            self._counts, self._wanted = list(reading.counts), angles
        stuck = 0
        torques = (self._of_torques @ excess).tolist()
        for i, counts in enumerate(reading.counts):
            is_still = abs(counts - self._counts[i]) <= _TREMBLE
            if not is_still or not reading.fresh >> i & 1:
                self._counts[i], self._wanted[i] = counts, angles[i]
            elif abs(angles[i] - self._wanted[i]) > self._in_vain[i]:
                is_pulled = abs(torques[i]) > self._breakaway[i]
                stuck = stuck or (i + 1 if is_pulled else 0)
        return stuck
