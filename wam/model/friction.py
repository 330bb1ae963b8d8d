"""Coulomb, Stribeck and viscous friction of the drives, as torques at the motors.

Friction acts where the cables run over pulleys, so it is modelled at the motors: both
motors of a differential have friction whenever either of its joints turns. The steady
torque of a motor at speed w is

    g(w) = (F_c +- F_a + mu (|tau| - |tau_0|)) (1 + ripple) S(w)
    S(w) = 1 + (s - 1) / (1 + (w / w_s)^2)        Stribeck curve

against the motion, plus b w. Below g a bristle deflects elastically, as in the
elasto-plastic model of Dupont, Hayward, Armstrong and Altpeter (2002): the deflection
rate is the motion times 1 - alpha |z|, z in units of the sliding deflection.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from wam.model.constants import ArmConstants, Array

_LARGEST = 1e4  # of any parameter
ELASTIC = 0.7  # share of the sliding deflection up to which a bristle is elastic
_PLASTIC = 1.0 - ELASTIC


@dataclass(frozen=True, slots=True)
class MotorFriction:
    """Friction of the seven drives; N m, rad and rad/s at the motors, shapes (7,).

    Attributes:
        coulomb: F_c, mean of both senses at the load `load_at` [N m].
        asymmetry: F_a, half of (forward - backward) [N m].
        load: mu, increase with the motor's load torque [N m per N m].
        load_at: |tau_0|, reference load of `coulomb` [N m].
        breakaway: s, break-away torque as a multiple of sliding torque.
        stribeck: w_s, speed at half of the break-away excess [rad/s].
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
        """Return the parameters as lists, by name."""
        return {
            field.name: getattr(self, field.name).tolist() for field in fields(self)
        }

    def dry(self, angle: Array, tau: Array, sense: Array) -> Array:
        """Return the dry friction of fast sliding [N m], shape (..., 7), above 0.

        Args:
            angle: motor angles [rad], shape (..., 7).
            tau: load torques of the motors [N m], shape (..., 7).
            sense: sense of motion, +1 or -1, shape (..., 7).
        """
        ripple = self.ripple_sin * np.sin(angle) + self.ripple_cos * np.cos(angle)
        growth = self.load * (np.abs(tau) - self.load_at)
        base = self.coulomb + growth + sense * self.asymmetry
        return np.maximum(base, 1e-9) * (1.0 + ripple)

    def steady(self, angle: Array, tau: Array, speed: Array) -> Array:
        """Return the friction torque of steady motion at `speed` [N m], (..., 7).

        Args:
            angle: motor angles [rad], shape (..., 7).
            tau: load torques of the motors [N m], shape (..., 7).
            speed: signed motor speeds [rad/s], shape (..., 7).
        """
        excess = (self.breakaway - 1.0) / (1.0 + (speed / self.stribeck) ** 2)
        sense = np.where(speed < 0.0, -1.0, 1.0)
        dry = self.dry(angle, tau, sense) * (1.0 + excess)
        return sense * dry + self.viscous * speed


def friction_of(metadata: Mapping[str, object]) -> MotorFriction:
    """Return the friction with the parameters of `MotorFriction.metadata`.

    Raises:
        KeyError: a parameter is missing.
        ValueError: not seven finite numbers, or out of range.
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
    """Return alpha of the elasto-plastic model for a growing deflection.

    For a decreasing deflection alpha is 0 (elastic).

    Args:
        deflection: |z|, 1 in steady sliding.
    """
    share = (deflection - ELASTIC) / _PLASTIC
    return 0.0 if share < 0.0 else 1.0 if share > 1.0 else share


def joint_coulomb(constants: ArmConstants, coulomb: Array) -> Array:
    """Return the Coulomb torque of each joint turning alone [N m], shape (7,).

    Args:
        constants: constants of the arm.
        coulomb: Coulomb torques of the motors [N m], shape (7,).
    """
    return np.abs(constants.j2mp).T @ coulomb


def motor_shares(constants: ArmConstants, of_joints: Array, power: int) -> Array:
    """Return motor values whose sum at the joints is a given quantity, shape (7,).

    Torques add up at a joint by |j2mp|, damping by j2mp^2. Both motors of a
    differential get the mean of the values for its two joints.

    Args:
        constants: constants of the arm.
        of_joints: the quantity at the joints, shape (7,).
        power: 1 for torques, 2 for damping.
    """
    weights = np.abs(constants.j2mp) ** power
    per_joint = of_joints / weights.sum(axis=0)
    is_coupled = weights > 0.0
    return (is_coupled * per_joint).sum(axis=1) / is_coupled.sum(axis=1)


def largest_motor_ratios(constants: ArmConstants) -> Array:
    """Return the largest |d motor / d joint| of each motor, shape (7,)."""
    return np.abs(constants.j2mp).max(axis=1)
