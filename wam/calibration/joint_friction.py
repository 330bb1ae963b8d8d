"""Friction of single joints, derived from the friction of the motors."""

import numpy as np

from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction, joint_coulomb


def joint_deviation(constants: ArmConstants, deviation: Array) -> Array:
    """Return the standard deviation of each joint's Coulomb torque [N m], (7,)."""
    return np.sqrt((constants.j2mp**2).T @ deviation**2)


def joint_asymmetry(constants: ArmConstants, asymmetry: Array) -> Array:
    """Return half of (forward - backward) friction of each joint alone [N m], (7,)."""
    return constants.j2mp.T @ asymmetry


def speed_curve(
    constants: ArmConstants, friction: MotorFriction, joint: int, speeds: Array
) -> Array:
    """Return the friction torque of a joint turning alone [N m], shape (n,).

    Mean of both directions at the reference load, without ripple.

    Args:
        constants: constants of the arm.
        friction: friction of its motors.
        joint: 0-6.
        speeds: joint speeds [rad/s], shape (n,), above 0.
    """
    shares = np.abs(constants.j2mp[:, joint])
    motors = speeds[:, None] * shares
    excess = (friction.breakaway - 1.0) / (1.0 + (motors / friction.stribeck) ** 2)
    torques = friction.coulomb * (1.0 + excess) + friction.viscous * motors
    return torques @ shares


def joint_breakaway(constants: ArmConstants, friction: MotorFriction) -> Array:
    """Return the break-away torque of each joint, mean of both senses [N m], (7,)."""
    return joint_coulomb(constants, friction.coulomb * friction.breakaway)
