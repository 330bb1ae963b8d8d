"""Friction calibration as TOML: identified parameters and their uncertainty."""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from acquisition.errors import SettingsError
from acquisition.settings import Number, Whole
from acquisition.toml_files import TomlFile, TomlTable
from acquisition.validation import Entries, Many
from wam.calibration.arm_identity import SerialNumbers
from wam.calibration.friction_fit import FrictionFit
from wam.calibration.joint_friction import (
    joint_asymmetry,
    joint_breakaway,
    joint_deviation,
)
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction, friction_of, joint_coulomb

_Moment = Annotated[Number, Field(gt=-10, lt=10)]  # kg m
_Number = Annotated[Number, Field(gt=-1e4, lt=1e4)]
_Seven = tuple[_Number, _Number, _Number, _Number, _Number, _Number, _Number]


@dataclass(frozen=True, slots=True)
class FrictionCalibration:
    """Identified friction of an arm.

    Attributes:
        fit: friction of the motors and its uncertainty.
        foot: name of the mounted foot.
        gravity: subtracted gravity model: cad, shipped or calibrated.
        measured_utc: time of the measurement.
        is_simulated: the arm was simulated.
        is_forced: a person accepted it although `check_friction` refuses it.
        arm: serial numbers of the seven pucks; None = unknown.
    """

    fit: FrictionFit
    foot: str
    gravity: str
    measured_utc: str
    is_simulated: bool
    is_forced: bool = False
    arm: tuple[int, ...] | None = None


class _FitTable(TomlTable):
    """Uncertainty of the motors' parameters."""

    deviation: _Seven
    asymmetry_deviation: _Seven
    residual: _Seven
    rows: Annotated[Many[Whole], Field(min_length=7, max_length=7)]
    moments: Annotated[
        Many[tuple[_Moment, _Moment, _Moment]], Field(min_length=7, max_length=7)
    ] = Field(
        description="To be added to the first moments whose weight was subtracted "
        "[kg m]."
    )

    @field_validator("deviation", "asymmetry_deviation")
    @classmethod
    def _is_not_negative(cls, deviation: tuple[float, ...]) -> tuple[float, ...]:
        if min(deviation) < 0.0:
            raise ValueError("a deviation is below 0")
        return deviation


class _FrictionFile(TomlFile):
    """File layout of a calibration; the joint values are for people, not read back."""

    foot: str
    gravity: str
    measured_utc: str
    is_simulated: bool = Field(strict=True)
    is_forced: bool = Field(default=False, strict=True)
    arm: SerialNumbers | None = None
    coulomb: Any = Field(
        default=None,
        description="At the joints 1 to 7, each turning alone [N m].",
    )
    asymmetry: Any = None
    breakaway: Any = None
    coulomb_deviation: Any = None
    coulomb_lower_bound: Any = None
    motors: Entries[str, _Seven] = Field(description="At the motors 1 to 7.")
    fit: _FitTable = Field(
        description="How well the motors are known; residuals are shares of Coulomb "
        "friction."
    )


def friction_to_toml(calibration: FrictionCalibration, constants: ArmConstants) -> str:
    """Return the text of a calibration file."""
    fit = calibration.fit
    file = _FrictionFile.model_construct(
        foot=calibration.foot,
        gravity=calibration.gravity,
        measured_utc=calibration.measured_utc,
        is_simulated=calibration.is_simulated,
        is_forced=calibration.is_forced,
        arm=calibration.arm,
        **_joint_values(constants, fit.friction),
        coulomb_deviation=joint_deviation(constants, fit.deviation).tolist(),
        coulomb_lower_bound=joint_coulomb(constants, fit.lower_bound).tolist(),
        motors=fit.friction.metadata(),
        fit=_FitTable.model_construct(
            deviation=fit.deviation.tolist(),
            asymmetry_deviation=fit.asymmetry_deviation.tolist(),
            residual=fit.residual.tolist(),
            rows=fit.rows,
            moments=fit.moments.tolist(),
        ),
    )
    return file.text("Friction of this arm as identified. SI units.")


def truth_to_toml(
    friction: MotorFriction, load_at: Array, constants: ArmConstants
) -> str:
    """Return the true friction of a simulated arm in the layout of a calibration.

    Args:
        friction: friction of the simulated motors.
        load_at: reference loads of the calibration's Coulomb friction [N m], (7,).
        constants: constants of the arm.
    """
    coulomb = friction.coulomb + friction.load * (load_at - friction.load_at)
    presliding = friction.presliding * coulomb / friction.coulomb  # same stiffness
    at_load = replace(friction, coulomb=coulomb, load_at=load_at, presliding=presliding)
    file = _FrictionFile.model_construct(
        is_simulated=True,
        **_joint_values(constants, at_load),
        motors=at_load.metadata(),
    )
    return file.text("Friction that the simulated arm really has. SI units.")


def friction_from_toml(text: str, name: str) -> FrictionCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is not a calibration of friction.
    """
    try:
        file = _FrictionFile.parse(text)
        friction = friction_of(file.motors)
    except (KeyError, ValueError) as error:
        is_key = isinstance(error, KeyError)
        what = f"motors.{error.args[0]} is missing" if is_key else str(error)
        raise SettingsError(
            f"{name} is not a calibration of friction: {what}.",
            hint="Make one with: traction calibrate friction. Nothing was started.",
        ) from error
    fit = FrictionFit(
        friction=friction,
        deviation=np.array(file.fit.deviation),
        asymmetry_deviation=np.array(file.fit.asymmetry_deviation),
        residual=np.array(file.fit.residual),
        rows=file.fit.rows,
        moments=np.array(file.fit.moments),
    )
    return FrictionCalibration(
        fit=fit,
        foot=file.foot,
        gravity=file.gravity,
        measured_utc=file.measured_utc,
        is_simulated=file.is_simulated,
        is_forced=file.is_forced,
        arm=file.arm,
    )


def _joint_values(constants: ArmConstants, friction: MotorFriction) -> dict[str, Any]:
    """Return friction torques of each joint turning alone [N m], joints 1 to 7."""
    return {
        "coulomb": joint_coulomb(constants, friction.coulomb).tolist(),
        "asymmetry": joint_asymmetry(constants, friction.asymmetry).tolist(),
        "breakaway": joint_breakaway(constants, friction).tolist(),
    }
