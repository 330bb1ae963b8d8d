"""Where home is, compared with the absolute encoders of the motors."""

from collections.abc import Sequence

import numpy as np

from acquisition.errors import IDLE_ARM, PreflightError
from wam.model.constants import ArmConstants, Array

HOME_LIMIT = 0.03  # rad; by eye an arm is put against its stops to about a degree


def home_error(
    j2mp: Array,
    cts: Sequence[int],
    mech: Sequence[float],
    mech_at_home: Sequence[float],
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
    """Return how far the joints are from where their positions put them [rad], (7,).

    Motors are known within their turn only: an error of joint 1 modulo 0.15 rad, of
    joint 4 modulo 0.35 rad.

    Args:
        constants: of the arm.
        cts: counts per motor turn, seven.
        counts: positions that the pucks tell [counts], seven.
        mech: absolute motor angles at the same place [counts], seven.
        mech_at_home: absolute motor angles where home was defined [counts], seven.
    """
    turn = np.array(cts, dtype=np.float64)
    home = turn / (2.0 * np.pi) * (constants.j2mp @ constants.home)
    travelled = np.array(counts, dtype=np.float64) - home
    wanted = (np.array(mech_at_home) + travelled) % turn
    return home_error(constants.j2mp, cts, mech, wanted.tolist())


def check_zero(error: Array) -> None:
    """Refuse an arm that is zeroed elsewhere than last time.

    Raises:
        PreflightError: a joint is more than 0.03 rad off.
    """
    joint = int(np.abs(error).argmax())
    if abs(error[joint]) > HOME_LIMIT:
        raise PreflightError(
            f"Joint {joint + 1} is {error[joint]:+.3f} rad from where its position "
            f"puts it (limit {HOME_LIMIT}), by its motor's absolute encoder.",
            arm_state=IDLE_ARM,
            hint="The zero is wrong: put the arm at home, then: traction zero.",
        )
