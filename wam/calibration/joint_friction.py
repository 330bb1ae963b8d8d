"""What joints that turn alone meet, from the friction of the motors."""

import numpy as np

from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction, joint_coulomb


def joint_deviation(constants: ArmConstants, deviation: Array) -> Array:
    """Return the standard deviation of each joint's Coulomb torque [N m], (7,)."""
    return np.sqrt((constants.j2mp**2).T @ deviation**2)


def joint_asymmetry(constants: ArmConstants, asymmetry: Array) -> Array:
    """Return half of forwards less backwards at each joint alone [N m], shape (7,)."""
    return constants.j2mp.T @ asymmetry


def speed_curve(
    constants: ArmConstants, friction: MotorFriction, joint: int, speeds: Array
) -> Array:
    """Return the torque against a joint that turns alone [N m], shape (n,).

    Mean of both ways, at the torque at which `coulomb` holds, without the ripple.

    Args:
        constants: of the arm.
        friction: of its motors.
        joint: 0-6.
        speeds: of the joint [rad/s], shape (n,), above 0.
    """
    shares = np.abs(constants.j2mp[:, joint])
    motors = speeds[:, None] * shares
    excess = (friction.breakaway - 1.0) / (1.0 + (motors / friction.stribeck) ** 2)
    torques = friction.coulomb * (1.0 + excess) + friction.viscous * motors
    return torques @ shares


def joint_breakaway(constants: ArmConstants, friction: MotorFriction) -> Array:
    """Return the torque that breaks each joint away, mean of both ways [N m], (7,)."""
    return joint_coulomb(constants, friction.coulomb * friction.breakaway)
