"""Dry and viscous friction of the drives, as torques at the motors.

Friction sits where the cables run over pulleys, so it is stated for the motors: where a
differential couples two joints, both of its motors rub whenever either joint turns. The
steady torque of a motor that turns at w is

    g(w) = (F_c +- F_a + mu (|tau| - |tau_0|)) (1 + ripple) S(w)
    S(w) = 1 + (s - 1) / (1 + (w / w_s)^2)

in the sense of the motion, plus b w. Below g a bristle gives way elastically, as in the
elasto-plastic model of Dupont, Hayward, Armstrong and Altpeter: its deflection follows
the motion by 1 - alpha |z|, z in units of the deflection at which it slides.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from wam.model.constants import ArmConstants, Array

_LARGEST = 1e4  # of any parameter
ELASTIC = 0.7  # share of the sliding deflection below which a bristle only bends
_PLASTIC = 1.0 - ELASTIC


@dataclass(frozen=True, slots=True)
class MotorFriction:
    """Friction of the seven drives; N m, rad and rad/s at the motors, shapes (7,).

    Attributes:
        coulomb: F_c, mean of both ways at the torque `load_at` [N m].
        asymmetry: F_a, half of forwards minus backwards [N m].
        load: mu, growth with the torque that the motor bears [N m per N m].
        load_at: |tau_0|, torque at which `coulomb` holds [N m].
        breakaway: s, torque at standstill as a multiple of sliding torque.
        stribeck: w_s, speed at which half of the difference is gone [rad/s].
        viscous: b [N m s/rad].
        ripple_sin: share of sin(angle of the motor) in the dry friction.
        ripple_cos: share of cos(angle of the motor).
        presliding: deflection at which standstill becomes sliding [rad].
    """

    coulomb: Array
    asymmetry: Array
    load: Array
    load_at: Array
    breakaway: Array
    stribeck: Array
    viscous: Array
    ripple_sin: Array
    ripple_cos: Array
    presliding: Array

    def metadata(self) -> dict[str, list[float]]:
        """Return the parameters in plain values, by name."""
        return {
            field.name: getattr(self, field.name).tolist() for field in fields(self)
        }

    def dry(self, angle: Array, tau: Array, sense: Array) -> Array:
        """Return the dry friction of fast sliding [N m], shape (..., 7), above 0.

        Args:
            angle: of the motors [rad], shape (..., 7).
            tau: torques that the motors bear [N m], shape (..., 7).
            sense: of the motion, +1 or -1, shape (..., 7).
        """
        ripple = self.ripple_sin * np.sin(angle) + self.ripple_cos * np.cos(angle)
        growth = self.load * (np.abs(tau) - self.load_at)
        level = self.coulomb + growth + sense * self.asymmetry
        return np.maximum(level, 1e-9) * (1.0 + ripple)

    def steady(self, angle: Array, tau: Array, speed: Array) -> Array:
        """Return the torque against a steady motion at `speed` [N m], shape (..., 7).

        Args:
            angle: of the motors [rad], shape (..., 7).
            tau: torques that the motors bear [N m], shape (..., 7).
            speed: of the motors [rad/s], shape (..., 7); its sign is the sense.
        """
        excess = (self.breakaway - 1.0) / (1.0 + (speed / self.stribeck) ** 2)
        sense = np.where(speed < 0.0, -1.0, 1.0)
        dry = self.dry(angle, tau, sense) * (1.0 + excess)
        return sense * dry + self.viscous * speed


def friction_of(metadata: Mapping[str, object]) -> MotorFriction:
    """Return the friction that `MotorFriction.metadata` describes.

    Raises:
        KeyError: a parameter is missing.
        ValueError: one has not seven finite numbers, or cannot be true.
    """
    friction = MotorFriction(
        **{field.name: _seven(metadata[field.name]) for field in fields(MotorFriction)}
    )
    above_0 = (friction.coulomb, friction.stribeck, friction.presliding)
    if min(float(column.min()) for column in above_0) <= 0.0:
        raise ValueError("coulomb, stribeck and presliding are above 0")
    if float(friction.breakaway.min()) < 1.0:
        raise ValueError("breakaway is 1 or more")
    return friction


def _seven(value: object) -> Array:
    array = np.array(value, dtype=np.float64)
    if array.shape != (7,) or not bool((np.abs(array) < _LARGEST).all()):
        raise ValueError("expected seven finite numbers")
    return array


def plastic_share(deflection: float) -> float:
    """Return alpha, the share of a motion that slides instead of bending the bristle.

    For a motion that bends it further; one that unbends it is elastic (alpha = 0).

    Args:
        deflection: |z|, 1 = that of steady sliding.
    """
    share = (deflection - ELASTIC) / _PLASTIC
    return 0.0 if share < 0.0 else 1.0 if share > 1.0 else share


def joint_coulomb(constants: ArmConstants, coulomb: Array) -> Array:
    """Return the Coulomb torque at each joint that turns alone [N m], shape (7,).

    Args:
        constants: of the arm.
        coulomb: at the motors [N m], shape (7,).
    """
    return np.abs(constants.j2mp).T @ coulomb


def motor_shares(constants: ArmConstants, of_joints: Array, power: int) -> Array:
    """Return what the motors contribute to a quantity of the joints, shape (7,).

    Torques add up at a joint by |j2mp|, damping by j2mp^2. A differential has one
    figure for both of its motors: the mean of what its two joints ask for.

    Args:
        constants: of the arm.
        of_joints: the quantity at the joints, shape (7,).
        power: 1 for torques, 2 for damping.
    """
    weights = np.abs(constants.j2mp) ** power
    wanted = of_joints / weights.sum(axis=0)
    is_coupled = weights > 0.0
    return (is_coupled * wanted).sum(axis=1) / is_coupled.sum(axis=1)


def motor_turns(constants: ArmConstants) -> Array:
    """Return how far each motor turns per radian of its quickest joint, shape (7,)."""
    return np.abs(constants.j2mp).max(axis=1)
