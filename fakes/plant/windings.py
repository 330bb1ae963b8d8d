"""Damping by shorted motor windings, which a WAM has instead of brakes.

In IDLE and without power each motor's windings are shorted. A turning motor generates
the current Kt w / R and thus the torque (Kt^2 / R) w against the motion: a damper
without holding torque. By the square of the gear ratio, joint 2 has 96 N m s/rad.
"""

import numpy as np

from fakes.plant.friction import FrictionParameter
from fakes.randomness import winding_generator
from wam.model.constants import Array

# Published data of motors 1-4, 5-6 and 7: N m/A, and ohm from phase to phase.
TORQUE_CONSTANTS = (0.457, 0.457, 0.457, 0.457, 0.236, 0.236, 0.067)
RESISTANCES = (3.47, 3.47, 3.47, 3.47, 6.21, 6.21, 5.2)
# Resistance of leads, temperature and the puck's bridge is not published.
WINDINGS = FrictionParameter(
    "windings", "of Kt^2/R", 1.0, 0.5, 2.0, "motor data; spread ASSUMED"
)


def shorted_damping(share: float = 1.0, seed: int | None = None) -> Array:
    """Return the damping of the motors with shorted windings [N m s/rad], shape (7,).

    Args:
        share: factor of the damping by the motors' data.
        seed: seed of a spread between arms, common to all motors; None = no spread.
    """
    drawn = WINDINGS.nominal
    if seed is not None:
        low, high = np.log([WINDINGS.low, WINDINGS.high])
        drawn = float(np.exp(winding_generator(seed).uniform(low, high)))
    return share * drawn * np.square(TORQUE_CONSTANTS) / np.array(RESISTANCES)
