"""Shorted motor windings: what an idle WAM has instead of brakes.

In IDLE and without power each motor's windings are shorted. A turning motor then makes
the current Kt w / R, and that the torque (Kt^2 / R) w against the motion: a damper,
which holds nothing. Through the gear ratio squared joint 2 has about 96 N m s/rad.
"""

import numpy as np

from fakes.plant.friction import FrictionParameter
from fakes.randomness import winding_generator
from wam.model.constants import Array

# Published data of the motors 1-4, 5-6 and 7: N m/A, and ohm from phase to phase.
TORQUE_CONSTANTS = (0.457, 0.457, 0.457, 0.457, 0.236, 0.236, 0.067)
RESISTANCES = (3.47, 3.47, 3.47, 3.47, 6.21, 6.21, 5.2)
# Leads, warmth and what the puck's bridge lets through are not published.
WINDINGS = FrictionParameter(
    "windings", "of Kt^2/R", 1.0, 0.5, 2.0, "motor data; spread ASSUMED"
)


def shorted_damping(share: float = 1.0, seed: int | None = None) -> Array:
    """Return the damping of the motors with shorted windings [N m s/rad], shape (7,).

    Args:
        share: of what the motors' data say.
        seed: of a spread between arms, one share for all motors; None = no spread.
    """
    drawn = WINDINGS.nominal
    if seed is not None:
        low, high = np.log([WINDINGS.low, WINDINGS.high])
        drawn = float(np.exp(winding_generator(seed).uniform(low, high)))
    return share * drawn * np.square(TORQUE_CONSTANTS) / np.array(RESISTANCES)
