"""Is the arm where it was when home was last defined? The absolute encoders know.

MECH is the angle of a motor within its turn and outlives power and zeroing. Against the
value noted at home it tells how far every motor is from there, but for whole turns:

    q - q_home = j2mp^-1 (2 pi / CTS) wrap(MECH - MECH_home),   |wrap| <= half a turn

Half a turn of the motor is 0.075 rad at joint 1 and 0.11 to 0.32 rad at the others.
"""

from collections.abc import Sequence

import numpy as np

from acquisition.errors import PreflightError
from wam.model.constants import Array

LARGEST = 0.03  # rad; by eye an arm is put against its stops to about a degree


def home_error(
    j2mp: Array, cts: Sequence[int], mech: Sequence[int], mech_at_home: Sequence[int]
) -> Array:
    """Return how far the joints are from home [rad], shape (7,).

    Args:
        j2mp: motor angles from joint angles, shape (7, 7).
        cts: counts per motor turn, seven.
        mech: absolute motor angles now [counts], seven.
        mech_at_home: the same when home was defined, seven.
    """
    turn: Array = np.array(cts, dtype=np.float64)
    apart = np.array(mech, dtype=np.float64) - np.array(mech_at_home, dtype=np.float64)
    wrapped = (apart + turn / 2) % turn - turn / 2
    return np.asarray(np.linalg.solve(j2mp, 2 * np.pi / turn * wrapped), np.float64)


def check_home(error: Array) -> None:
    """Refuse to define home where it was not last time.

    Raises:
        PreflightError: a joint is more than 0.03 rad from where home was.
    """
    joint = int(np.abs(error).argmax())
    if abs(error[joint]) > LARGEST:
        raise PreflightError(
            f"Joint {joint + 1} is {error[joint]:+.3f} rad from where home was last "
            f"time (limit {LARGEST}), as far as its motor's absolute encoder tells.",
            arm_state="idle",
            hint="Put the arm against its stops and zero it again. If a cable was "
            "tensioned or a motor changed, take mech_at_home out of rig.toml.",
        )
