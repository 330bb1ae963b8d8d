"""A calibration of friction as TOML: what was identified, and how well."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from acquisition.settings import parse_toml
from wam.calibration.friction_fit import FrictionFit
from wam.calibration.joint_friction import (
    joint_asymmetry,
    joint_breakaway,
    joint_deviation,
)
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction, friction_of, joint_coulomb

_LARGEST_MOMENT = 10.0  # kg m
_LARGEST = 1e4  # of any number in the file


@dataclass(frozen=True, slots=True)
class FrictionCalibration:
    """Friction of an arm as identified.

    Attributes:
        fit: friction of the motors and how well it is known.
        foot: name of the foot that was on.
        gravity: which gravity was subtracted: cad, shipped or calibrated.
        measured_utc: when.
        is_simulated: the arm was a simulated one.
    """

    fit: FrictionFit
    foot: str
    gravity: str
    measured_utc: str
    is_simulated: bool


def friction_to_toml(calibration: FrictionCalibration, constants: ArmConstants) -> str:
    """Return the text of a calibration file."""
    fit = calibration.fit
    deviation = joint_deviation(constants, fit.deviation)
    bound = joint_coulomb(constants, fit.lower_bound)
    return (
        "# Friction of this arm as identified. SI units.\n"
        f'foot = "{calibration.foot}"\n'
        f'gravity = "{calibration.gravity}"\n'
        f'measured_utc = "{calibration.measured_utc}"\n'
        f"is_simulated = {str(calibration.is_simulated).lower()}\n"
        f"{_joint_lines(constants, fit.friction)}"
        f"{_line('coulomb_deviation', deviation)}"
        f"{_line('coulomb_lower_bound', bound)}"
        "\n# At the motors 1 to 7.\n[motors]\n"
        f"{_motor_lines(fit.friction)}"
        "\n# How well the motors are known; residuals are shares of Coulomb friction.\n"
        "[fit]\n"
        f"{_line('deviation', fit.deviation)}"
        f"{_line('asymmetry_deviation', fit.asymmetry_deviation)}"
        f"{_line('residual', fit.residual)}"
        f"rows = {list(fit.rows)}\n"
        "# To be added to the first moments whose weight was subtracted [kg m].\n"
        f"moments = {fit.moments.tolist()}\n"
    )


def truth_to_toml(
    friction: MotorFriction, load_at: Array, constants: ArmConstants
) -> str:
    """Return what a simulated arm really has, in the layout of a calibration.

    Args:
        friction: of the simulated motors.
        load_at: torques at which a calibration states Coulomb friction [N m], (7,).
        constants: of the arm.
    """
    coulomb = friction.coulomb + friction.load * (load_at - friction.load_at)
    presliding = friction.presliding * coulomb / friction.coulomb  # as stiff as it is
    there = replace(friction, coulomb=coulomb, load_at=load_at, presliding=presliding)
    return (
        "# Friction that the simulated arm really has. SI units.\n"
        "is_simulated = true\n"
        f"{_joint_lines(constants, there)}"
        "\n# At the motors 1 to 7.\n[motors]\n"
        f"{_motor_lines(there)}"
    )


def friction_from_toml(text: str, name: str) -> FrictionCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is not a calibration of friction.
    """
    try:
        table = parse_toml(text)
        if not isinstance(table["is_simulated"], bool):
            raise TypeError("is_simulated is neither true nor false")
        return FrictionCalibration(
            fit=_fit(table["motors"], table["fit"]),
            foot=str(table["foot"]),
            gravity=str(table["gravity"]),
            measured_utc=str(table["measured_utc"]),
            is_simulated=table["is_simulated"],
        )
    except KeyError as error:
        raise _wrong(name, f"{error.args[0]} is missing") from error
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise _wrong(name, str(error)) from error


def _fit(motors: dict[str, Any], quality: dict[str, Any]) -> FrictionFit:
    friction = friction_of(motors)
    names = ("deviation", "asymmetry_deviation", "residual", "rows")
    deviation, asymmetry, residual, rows = (_seven(quality[name]) for name in names)
    if min(float(column.min()) for column in (deviation, asymmetry)) < 0.0:
        raise ValueError("a deviation is below 0")
    return FrictionFit(
        friction=friction,
        deviation=deviation,
        asymmetry_deviation=asymmetry,
        residual=residual,
        rows=tuple(int(count) for count in rows.tolist()),
        moments=_moments(quality.get("moments")),
    )


def _moments(value: object) -> Array:
    """Return the change of first moments; files of before 0.2 have none."""
    array = np.zeros((7, 3)) if value is None else np.array(value, dtype=np.float64)
    if array.shape != (7, 3) or not bool((np.abs(array) < _LARGEST_MOMENT).all()):
        raise ValueError("moments: expected seven times three numbers below 10 kg m")
    return array


def _joint_lines(constants: ArmConstants, friction: MotorFriction) -> str:
    """Return what a joint that turns alone meets [N m], joints 1 to 7."""
    lines = {
        "coulomb": joint_coulomb(constants, friction.coulomb),
        "asymmetry": joint_asymmetry(constants, friction.asymmetry),
        "breakaway": joint_breakaway(constants, friction),
    }
    text = "".join(_line(name, values) for name, values in lines.items())
    return f"# At the joints 1 to 7, each turning alone [N m].\n{text}"


def _motor_lines(friction: MotorFriction) -> str:
    values = friction.metadata()
    return "".join(f"{name} = {numbers}\n" for name, numbers in values.items())


def _line(name: str, values: Array) -> str:
    return f"{name} = {values.tolist()}\n"


def _seven(value: object) -> Array:
    array = np.array(value, dtype=np.float64)
    if array.shape != (7,) or not bool((np.abs(array) < _LARGEST).all()):
        raise ValueError("expected seven finite numbers")
    return array


def _wrong(name: str, what: str) -> SettingsError:
    return SettingsError(
        f"{name} is not a calibration of friction: {what}.",
        hint="Make one with: traction calibrate friction. Nothing was started.",
    )
