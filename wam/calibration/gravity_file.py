"""Gravity calibration as TOML: first moments, residuals and measured torques."""

from dataclasses import dataclass, replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from acquisition.errors import SettingsError
from acquisition.settings import Number, Whole
from acquisition.toml_files import TomlFile, TomlTable
from acquisition.validation import Many
from wam.calibration.arm_identity import SerialNumbers
from wam.model.constants import ArmConstants, Array, Body
from wam.model.moments import (
    LARGEST_RESIDUAL,
    check_drawings,
    check_fit,
    check_zeros,
    evaluate_moments,
    zero_errors,
)
from wam.model.tool import Tool, tool_metadata, tool_of

_SAME = 1e-9  # kg and m: the tool of a calibration and of a session
_Moment = Annotated[Number, Field(ge=-10, le=10)]  # kg m; a Barrett arm's largest is 3
_Vector = tuple[Number, Number, Number]
_Seven = tuple[Number, Number, Number, Number, Number, Number, Number]


@dataclass(frozen=True, slots=True)
class GravityCalibration:
    """Measured first moments of an arm with its tool.

    Attributes:
        mus: first moments including the tool's [kg m], shape (7, 3).
        residual: rms torque residual of the fit [N m].
        rank: rank of the regressor over the poses.
        foot: name of the mounted foot.
        tool: sensor and foot on the tool plate.
        measured_utc: time of the measurement.
        is_simulated: the arm was simulated.
        poses: joint positions of the measurements [rad], shape (n, 7).
        torques: holding torques [N m], shape (n, 7).
        is_forced: a person accepted it although `check_gravity` refuses it.
        arm: serial numbers of the seven pucks; None = unknown.
    """

    mus: Array
    residual: float
    rank: int
    foot: str
    tool: Tool
    measured_utc: str
    is_simulated: bool
    poses: Array
    torques: Array
    is_forced: bool = False
    arm: tuple[int, ...] | None = None


class _BodyTable(TomlTable):
    mass: Number
    com: _Vector
    inertia: tuple[_Vector, _Vector, _Vector]


class _ToolTable(TomlTable):
    """Layout of `tool_metadata`."""

    sole: _Vector
    sensor_height: Number
    sensor_angle: Number
    sensor_sign: Number
    sensor: _BodyTable
    foot: _BodyTable


class _GravityFile(TomlFile):
    """The fields of `GravityCalibration`, in the order of the file."""

    foot: str
    measured_utc: str
    is_simulated: bool = Field(strict=True)
    is_forced: bool = Field(default=False, strict=True)
    arm: SerialNumbers | None = None
    residual: Number
    rank: Whole
    mus: Annotated[
        Many[tuple[_Moment, _Moment, _Moment]], Field(min_length=7, max_length=7)
    ]
    poses: Many[_Seven] = Field(min_length=1)
    torques: Many[_Seven]
    tool: _ToolTable

    @model_validator(mode="after")
    def _has_a_torque_for_each_pose(self) -> Self:
        if len(self.torques) != len(self.poses):
            raise ValueError(f"{len(self.poses)} poses, {len(self.torques)} torques")
        return self


def gravity_to_toml(calibration: GravityCalibration) -> str:
    """Return the text of a calibration file."""
    file = _GravityFile.model_construct(
        foot=calibration.foot,
        measured_utc=calibration.measured_utc,
        is_simulated=calibration.is_simulated,
        is_forced=calibration.is_forced,
        arm=calibration.arm,
        residual=calibration.residual,
        rank=calibration.rank,
        mus=calibration.mus.tolist(),
        poses=calibration.poses.tolist(),
        torques=calibration.torques.tolist(),
        tool=_ToolTable.model_validate(tool_metadata(calibration.tool)),
    )
    return file.text("Gravity of this arm with this tool. SI units, frames 1..7.")


def gravity_from_toml(text: str, name: str) -> GravityCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is not a gravity calibration.
    """
    try:
        file = _GravityFile.parse(text)
    except ValueError as error:
        raise SettingsError(
            f"{name} is not a gravity calibration: {error}.",
            hint="Make one with: traction calibrate gravity. Nothing was started.",
        ) from error
    return GravityCalibration(
        mus=np.array(file.mus),
        residual=file.residual,
        rank=file.rank,
        foot=file.foot,
        tool=tool_of(file.tool.model_dump()),
        measured_utc=file.measured_utc,
        is_simulated=file.is_simulated,
        poses=np.array(file.poses),
        torques=np.array(file.torques),
        is_forced=file.is_forced,
        arm=file.arm,
    )


def check_gravity(constants: ArmConstants, calibration: GravityCalibration) -> None:
    """Repeat the checks of `traction calibrate gravity` on the stored measurements.

    Raises:
        SettingsError: large residuals, rank-deficient poses, wrong joint zeros, or
            moments far from the drawings.
    """
    q, tool = calibration.poses, calibration.tool
    fit = evaluate_moments(constants, calibration.mus, q, calibration.torques)
    check_fit(replace(fit, rank=min(fit.rank, calibration.rank)))
    if not calibration.residual <= LARGEST_RESIDUAL:
        raise SettingsError(
            f"The torques leave {calibration.residual:.2f} N m unexplained, as the "
            f"file says (limit {LARGEST_RESIDUAL})."
        )
    check_zeros(zero_errors(constants, q, fit))
    check_drawings(constants, calibration.mus, (tool.sensor, tool.foot), q)


def fits_tool(calibration: GravityCalibration, tool: Tool) -> bool:
    """Return whether mass and centre of mass of `tool` match the calibrated tool's."""
    pairs = (
        (calibration.tool.sensor, tool.sensor),
        (calibration.tool.foot, tool.foot),
    )
    return all(_has_same_moment(theirs, ours) for theirs, ours in pairs)


def _has_same_moment(body: Body, other: Body) -> bool:
    is_near = np.abs(body.com - other.com) <= _SAME
    return abs(body.mass - other.mass) <= _SAME and bool(is_near.all())
