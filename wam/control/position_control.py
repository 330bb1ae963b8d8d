"""Joint position control: springs that hold the arm, trajectory and PD of a move."""

from dataclasses import dataclass

import numpy as np

from acquisition.devices import ArmReading
from wam.control.joint_lock import RAMP
from wam.model.constants import ArmConstants, Array

# Shares of the vendor's PD gains, which are tuned for moves: softer, and more damping
# for heavier joints. The damping ratio is at least 0.29 in every pose without drive
# friction, and the loop is stable at twice both gains:
# tests/wam/control/test_hold_stability.py.
_STIFFNESS = np.array([0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0])
_DAMPING = np.array([4.0, 3.0, 1.5, 3.0, 2.0, 2.0, 0.0])
# Share of TORQUE_LIMIT in guide, with the vendor's damping: a person moves joint 2 with
# 9 N at 0.7 m, and the arm stands still when released.
GUIDE_SHARE = 0.5
_SLOW = 0.05  # rad/s
# Spring torque limits, joints 1 to 7; the lock holds joint 7. Joint 2: three times the
# 4 N m of an unmodelled foot of 0.6 kg; a person moves the arm with 17 N at 0.7 m.
TORQUE_LIMIT = np.array([8.0, 12.0, 6.0, 6.0, 1.0, 1.0, 0.0])  # N m


class PositionHold:
    """Joint impedance: springs and dampers of joints 1 to 6.

        tau = clip(k (q_ref - q), -limit, limit) - d qd

    The reference is dragged along by a joint further away than limit / k (10 to 40
    mrad): a moving arm is braked by `limit` and the damper. The reference also follows
    a joint that the spring drives faster than 0.05 rad/s. Thus an arm that is pushed
    away stays there, and one that was stopped does not swing back.

    Attributes:
        stiffness: spring stiffness [N m/rad], shape (7,).
        damping: damping in hold [N m s/rad], shape (7,).
        guide_damping: damping in guide [N m s/rad], shape (7,).
    """

    def __init__(self, constants: ArmConstants) -> None:
        self.stiffness = _STIFFNESS * constants.kp
        self.damping = _DAMPING * constants.kd
        self.guide_damping = np.sign(_DAMPING) * constants.kd
        # Deflection at the torque limit [rad]; as Python floats for speed per cycle.
        self._reach = TORQUE_LIMIT / np.maximum(self.stiffness, 1.0)
        self._springs: list[tuple[float, float]] = list(
            zip(self.stiffness.tolist(), self._reach.tolist(), strict=True)
        )
        self._reference: list[float] | None = None

    def begin(self, q: Array, spring: Array | None = None) -> None:
        """Hold the joints at `q`; an arm already held keeps its reference.

        Args:
            q: joint positions [rad], shape (7,).
            spring: initial spring torques [N m], shape (7,); None = 0.
        """
        if self._reference is not None:
            return
        reference = q
        if spring is not None:
            error = spring / np.maximum(self.stiffness, 1.0)
            reference = q + np.clip(error, -self._reach, self._reach)
        self._reference = reference.tolist()

    def release(self) -> None:
        """Release the joints."""
        self._reference = None

    def spring(self, reading: ArmReading, share: float = 1.0) -> Array:
        """Return the spring torques [N m], shape (7,), limited to `share` of the limit.

        Also moves the reference.
        """
        if self._reference is None:
            return np.zeros(7)
        references, torques = list[float](), list[float]()
        q, qd = reading.q.tolist(), reading.qd.tolist()
        rows = zip(self._reference, q, qd, self._springs, strict=True)
        for reference, angle, rate, (stiffness, reach) in rows:
            error = min(max(reference - angle, -share * reach), share * reach)
            if error * rate > 0.0 and not -_SLOW <= rate <= _SLOW:
                error = 0.0
            references.append(angle + error)
            torques.append(stiffness * error)
        if reading.is_complete:  # extrapolated positions must not move the reference
            self._reference = references
        return np.array(torques)

    def torque(self, reading: ArmReading, *, is_guided: bool = False) -> Array:
        """Return spring and damper torques of joints 1 to 6 [N m], (7,).

        In guide: half the spring torque and less damping.
        """
        if is_guided:
            spring = self.spring(reading, GUIDE_SHARE)
            return spring - self.guide_damping * reading.qd
        return self.spring(reading) - self.damping * reading.qd


TOP_SPEED = 0.5  # rad/s
ACCELERATION = 0.5  # rad/s^2
# Joint 7: light and stiff, so it reaches its speed quickly with little overshoot.
TURN_ACCELERATION = 6.0  # rad/s^2
PD_TORQUE_LIMIT = np.array([25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0])  # N m, PD part only


@dataclass(frozen=True, slots=True)
class JointMove:
    """Straight joint-space trajectory from `start` to `goal` [rad], shapes (7,).

    The joint with the longest travel has a trapezoidal speed, the others in proportion:
    speed and acceleration are limited, jerk is not.
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
            remaining = T - t
            s, v = length - 0.5 * a * remaining * remaining, a * remaining
        direction = (self.goal - self.start) / length
        return self.start + s * direction, v * direction

    @property
    def _length(self) -> float:
        return float(np.abs(self.goal - self.start).max())


def move_reference(move: JointMove, t: float) -> tuple[Array, Array]:
    """Return reference (positions [rad], velocities [rad/s]), shapes (7,).

    Joint 7 turns separately, as soon as its lock has released: on a slow reference its
    torque would build up against stiction and throw the light joint. It turns the foot
    about its own axis, so the swept space is that of the straight path.

    Args:
        move: move of all joints.
        t: time since the start [s].
    """
    q, qd = move.at(t)
    turn = JointMove(move.start[6:], move.goal[6:], TOP_SPEED, TURN_ACCELERATION)
    q[6:], qd[6:] = turn.at(t - RAMP)
    return q, qd


def joint_pd(kp: Array, kd: Array, error: Array, rate_error: Array) -> Array:
    """Return kp e + kd de [N m], shape (7,), clipped to `PD_TORQUE_LIMIT`."""
    return np.clip(kp * error + kd * rate_error, -PD_TORQUE_LIMIT, PD_TORQUE_LIMIT)


# N m beyond gravity that certainly move a joint: 1.5 times the dry friction identified
# on another arm plus a quarter of the joint's gravity torque; joint 1 has no gravity
# torque: a tenth, for the reaction of the other joints as they start.
BREAKAWAY = np.array([4.4, 9.0, 4.5, 3.5, 0.7, 0.7, 0.16])
# Advance of the reference before a motor counts as stuck [rad at the joint]: a fifth of
# the error that dry friction can hold.
_STUCK_ADVANCE = np.array([1.0, 0.5, 0.5, 0.5, 2.0, 2.0, 3.0]) * 1e-3
_FLICKER = 1  # counts of encoder flicker at rest


class StallDetector:
    """Detects a motor that does not move although a move drives it.

    Its counts stay constant while the reference advances, at a torque above break-away:
    the encoder is frozen or the joint is blocked. With a frozen encoder the motor
    accelerates, so this must be detected before the position error is large.
    """

    def __init__(self, constants: ArmConstants) -> None:
        self._j2mp = np.array(constants.j2mp)
        self._of_torques = np.linalg.inv(self._j2mp).T
        self._breakaway: list[float] = (np.abs(self._of_torques) @ BREAKAWAY).tolist()
        self._stuck_advance: list[float] = (
            np.abs(self._j2mp) @ _STUCK_ADVANCE
        ).tolist()
        self.begin()

    def begin(self) -> None:
        """Reset for a new move."""
        self._counts: list[int] = []
        self._wanted: list[float] = []

    def stuck_motor(self, wanted: Array, excess: Array, reading: ArmReading) -> int:
        """Return the first stuck motor, 1-7; 0 = none.

        Args:
            wanted: reference joint positions of the move [rad], shape (7,).
            excess: commanded torques beyond gravity [N m], shape (7,).
            reading: reading of this cycle.
        """
        angles = (self._j2mp @ wanted).tolist()
        if not self._counts:
            self._counts, self._wanted = list(reading.counts), angles
        stuck = 0
        torques = (self._of_torques @ excess).tolist()
        for i, counts in enumerate(reading.counts):
            is_still = abs(counts - self._counts[i]) <= _FLICKER
            if not is_still or not reading.fresh >> i & 1:
                self._counts[i], self._wanted[i] = counts, angles[i]
            elif abs(angles[i] - self._wanted[i]) > self._stuck_advance[i]:
                is_pulled = abs(torques[i]) > self._breakaway[i]
                stuck = stuck or (i + 1 if is_pulled else 0)
        return stuck
