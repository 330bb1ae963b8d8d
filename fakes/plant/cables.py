"""Drives whose motors turn the joints through cables that give way.

    J w' = J w + dt (u - f - s),   s = k e' + b (w' - v),   e' = e + dt (w' - v)

J is the rotor's inertia, w its speed, u the torque sent, f its friction, e what the
cable is twisted by, v the speed at which the joints turn the cable's other end; all by
motor, in the motor's own angle. Solved for w' implicitly; the joints feel the s that
the motor felt, so nothing is lost or won between them. Encoders sit at the motors.

No WAM's cables have been published: their resonance is ASSUMED, see `CABLES`.
"""

from collections.abc import Sequence

import numpy as np

from fakes.plant.friction import ASSUMED, FrictionParameter
from fakes.plant.joints import JointDrives
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction

CABLES = FrictionParameter("cables", "Hz, motors held", np.inf, 8.0, 25.0, ASSUMED)
_STIFFEST = 40.0  # Hz, that steps of 0.5 ms follow
_DAMPING = 0.03  # of critical, of a joint on its cable; ASSUMED


class CableDrives(JointDrives):
    """The drives of an arm whose joints swing on their cables.

    Attributes:
        twist: of the cables: motor angle beyond the joints' [rad], shape (7,).
    """

    def __init__(
        self,
        constants: ArmConstants,
        friction: MotorFriction,
        inertia: Array,
        swinging: Array,
        dt: float,
        windings: Array,
        resonance: float,
    ) -> None:
        """Take the drives of an arm that stands without torque.

        Args:
            constants: of the arm.
            friction: of the motors.
            inertia: that a motor moves when it turns [kg m^2], shape (7,).
            swinging: what swings on the cable of each motor [kg m^2], shape (7,).
            dt: length of a step [s].
            windings: damping of each motor when shorted [N m s/rad], shape (7,).
            resonance: of a joint on its cable while motor and other joints are held
                [Hz].

        Raises:
            ValueError: no cable is like that, or the steps are too long for it.
        """
        if not 1.0 <= resonance <= _STIFFEST:
            raise ValueError(f"resonance {resonance} Hz is outside 1..{_STIFFEST:g}")
        rate = 2.0 * np.pi * resonance
        self._stiffness = rate * rate * swinging
        self._cable_damping = 2.0 * _DAMPING * rate * swinging
        self._rotor = np.array(constants.drive_inertia)
        self.twist, self._speeds = np.zeros(7), np.zeros(7)
        super().__init__(constants, friction, inertia, dt, windings)

    def counts(self, q: Array) -> Array:
        """Return what the encoders at the motors count, shape (7,)."""
        return super().counts(q) + self._turns * self.twist

    def rest(self) -> None:
        """Unbend bristles and cables of an arm that something bears."""
        super().rest()
        self.twist, self._speeds = np.zeros(7), np.zeros(7)

    def begin_cycle(self, rows: Array, speeds: Sequence[float], t_ns: int) -> None:
        """Take anew what stays as it is for 2 ms; arguments as of JointDrives."""
        del speeds  # of the joints: friction is at the motors
        motors = rows.copy()
        motors[0] = rows[0] + np.linalg.solve(self._j2mp, self.twist)
        self._bear(motors, self._speeds.tolist(), t_ns)
        self._stop(rows)
        self._resist(())

    def torques(self, rows: Array, speeds: Sequence[float]) -> list[float]:
        """Step the motors; return the torques of the cables at them [N m], seven.

        Arguments as of JointDrives.
        """
        if self._stopping.is_near or self.grip is not None:
            self._stop(rows)
            self._resist(())
        dt, bristles = self._dt, self._bristles
        bristles.take(self._speeds.tolist())
        bent = np.array(bristles.torques([0.0] * 7))
        stiffness, damping = self._stiffness, self._cable_damping
        held = damping + dt * stiffness
        damping = np.array(bristles.damping) + self._shorted
        inertia = self._rotor + dt * (damping + held)
        against = np.array(speeds)
        push = np.array(self.sent()) + bent - stiffness * self.twist + held * against
        self._speeds = motor = (self._rotor * self._speeds + dt * push) / inertia
        return (stiffness * self.twist + held * (motor - against)).tolist()

    def follow(self, speeds: Sequence[float]) -> None:
        """Go on by a step; the joints turn the cables at `speeds` [rad/s]."""
        self._bristles.follow(self._speeds.tolist())
        self.twist = self.twist + self._dt * (self._speeds - np.array(speeds))

    def _resist(self, speeds: Sequence[float]) -> None:
        del speeds
        damping = np.array(self._stopping.damping)
        if self.grip is not None:
            damping = damping + self.grip.against(self._dt)
        self.armature = self._dt * damping

    def _add_up(self) -> None:
        driving = self.disturbance
        if self._stopping.is_near:
            driving = driving + self._stopping.torques
        if self.grip is not None:
            driving = driving + self.grip.at(self._held_at)
        self.driving = driving.tolist()
