"""Check of the home position against the absolute encoders of the motors."""

from collections.abc import Sequence

import numpy as np

from acquisition.errors import IDLE_ARM, PreflightError
from wam.model.constants import ArmConstants, Array

HOME_LIMIT = 0.03  # rad; placing an arm against its stops by eye: about a degree


def home_error(
    j2mp: Array,
    cts: Sequence[int],
    mech: Sequence[float],
    mech_at_home: Sequence[float],
) -> Array:
    """Return the joints' deviation from home [rad], shape (7,).

    Args:
        j2mp: motor angles from joint angles, shape (7, 7).
        cts: counts per motor turn, seven.
        mech: present absolute motor angles [counts], seven.
        mech_at_home: absolute motor angles when home was defined [counts], seven.
    """
    turn: Array = np.array(cts, dtype=np.float64)
    difference = np.array(mech, dtype=np.float64) - np.array(
        mech_at_home, dtype=np.float64
    )
    wrapped = (difference + turn / 2) % turn - turn / 2
    return np.asarray(np.linalg.solve(j2mp, 2 * np.pi / turn * wrapped), np.float64)


def check_home(error: Array) -> None:
    """Refuse to define home away from the previous home.

    Raises:
        PreflightError: a joint is more than 0.03 rad from the previous home.
    """
    joint = int(np.abs(error).argmax())
    if abs(error[joint]) > HOME_LIMIT:
        raise PreflightError(
            f"Joint {joint + 1} is {error[joint]:+.3f} rad from where home was last "
            f"time (limit {HOME_LIMIT}), by its motor's absolute encoder.",
            arm_state=IDLE_ARM,
            hint="Put the arm against its stops and zero it again. If a cable was "
            "tensioned or a motor changed, take mech_at_home out of rig.toml.",
        )


def zero_error(
    constants: ArmConstants,
    cts: Sequence[int],
    counts: Sequence[int],
    mech: Sequence[int],
    mech_at_home: Sequence[int],
) -> Array:
    """Return the zero errors of the joints by the absolute encoders [rad], (7,).

    The encoders are absolute within one motor turn only: the error of joint 1 is known
    modulo 0.15 rad, that of joint 4 modulo 0.35 rad.

    Args:
        constants: constants of the arm.
        cts: counts per motor turn, seven.
        counts: positions reported by the pucks [counts], seven.
        mech: absolute motor angles at the same pose [counts], seven.
        mech_at_home: absolute motor angles when home was defined [counts], seven.
    """
    turn = np.array(cts, dtype=np.float64)
    home = turn / (2.0 * np.pi) * (constants.j2mp @ constants.home)
    travelled = np.array(counts, dtype=np.float64) - home
    expected = (np.array(mech_at_home) + travelled) % turn
    return home_error(constants.j2mp, cts, mech, expected.tolist())


def check_zero(error: Array) -> None:
    """Refuse an arm whose zero differs from the previous one.

    Raises:
        PreflightError: a zero error exceeds 0.03 rad.
    """
    joint = int(np.abs(error).argmax())
    if abs(error[joint]) > HOME_LIMIT:
        raise PreflightError(
            f"Joint {joint + 1} is {error[joint]:+.3f} rad from where its position "
            f"puts it (limit {HOME_LIMIT}), by its motor's absolute encoder.",
            arm_state=IDLE_ARM,
            hint="The zero is wrong: put the arm at home, then: traction zero.",
        )
