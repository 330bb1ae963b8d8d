"""Drives with elastic cables between motors and joints.

    J w' = J w + dt (u - f - s),   s = k e' + b (w' - v),   e' = e + dt (w' - v)

J is the rotor's inertia, w its speed, u the commanded torque, f its friction, e the
twist of the cable, v the speed of the cable's joint end; all per motor, in motor
angles. Solved implicitly for w'; the same s acts on motor and joints, so the coupling
conserves energy. Encoders are at the motors.

No data of a WAM's cables are published: their resonance is ASSUMED, see `CABLES`.
"""

from collections.abc import Sequence

import numpy as np

from fakes.plant.friction import ASSUMED, FrictionParameter
from fakes.plant.joints import JointDrives
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction

CABLES = FrictionParameter("cables", "Hz, motors held", np.inf, 8.0, 25.0, ASSUMED)
_STIFFEST = 40.0  # Hz; limit of stable steps of 0.5 ms
_DAMPING = 0.03  # damping ratio of a joint on its cable; ASSUMED


class CableDrives(JointDrives):
    """Drives of an arm with elastic cables.

    Attributes:
        twist: twist of the cables: motor angle minus that by the joints [rad], (7,).
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
        """Start at rest without torque.

        Args:
            constants: constants of the arm.
            friction: friction of the motors.
            inertia: effective inertia at each motor [kg m^2], shape (7,).
            swinging: inertia on the cable of each motor [kg m^2], shape (7,).
            dt: length of a step [s].
            windings: damping of each motor when shorted [N m s/rad], shape (7,).
            resonance: resonance of a joint on its cable, with motor and other joints
                held [Hz].

        Raises:
            ValueError: the resonance is out of range.
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
        """Return the counts of the motor encoders, shape (7,)."""
        return super().counts(q) + self._turns * self.twist

    def rest(self) -> None:
        """Relax bristles and cables of a supported arm."""
        super().rest()
        self.twist, self._speeds = np.zeros(7), np.zeros(7)

    def begin_cycle(self, rows: Array, speeds: Sequence[float], t_ns: int) -> None:
        """Refresh the quantities held constant during one cycle; see JointDrives."""
        del speeds  # by the joints; friction depends on the motors' own speeds
        motors = rows.copy()
        motors[0] = rows[0] + np.linalg.solve(self._j2mp, self.twist)
        self._bear(motors, self._speeds.tolist(), t_ns)
        self._stop(rows)
        self._resist(())

    def torques(self, rows: Array, speeds: Sequence[float]) -> list[float]:
        """Step the motors; return the cable torques at the motors [N m], seven.

        Arguments as for JointDrives.
        """
        if self._stopping.is_near or self.grip is not None:
            self._stop(rows)
            self._resist(())
        dt, bristles = self._dt, self._bristles
        bristles.take(self._speeds.tolist())
        bristle_torques = np.array(bristles.torques([0.0] * 7))
        stiffness, damping = self._stiffness, self._cable_damping
        coupling = damping + dt * stiffness
        damping = np.array(bristles.damping) + self._shorted
        inertia = self._rotor + dt * (damping + coupling)
        end_speeds = np.array(speeds)
        push = (
            np.array(self.sent())
            + bristle_torques
            - stiffness * self.twist
            + coupling * end_speeds
        )
        self._speeds = motor = (self._rotor * self._speeds + dt * push) / inertia
        return (stiffness * self.twist + coupling * (motor - end_speeds)).tolist()

    def follow(self, speeds: Sequence[float]) -> None:
        """Advance by a step with cable ends turning at `speeds` [rad/s]."""
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
