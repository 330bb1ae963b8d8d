"""A gravity calibration as TOML: first moments, how well they fit, what was fitted."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from acquisition.errors import SettingsError
from acquisition.settings import Number, Whole
from acquisition.toml_files import TomlFile, TomlTable
from acquisition.validation import Many
from wam.model.constants import Array, Body
from wam.model.tool import Tool, tool_metadata, tool_of

_SAME = 1e-9  # kg and m: the tool of a calibration and of a session
_Moment = Annotated[Number, Field(ge=-10, le=10)]  # kg m; a Barrett arm's largest is 3
_Vector = tuple[Number, Number, Number]
_Seven = tuple[Number, Number, Number, Number, Number, Number, Number]


@dataclass(frozen=True, slots=True)
class GravityCalibration:
    """First moments of an arm with a tool, as measured.

    Attributes:
        mus: first moments [kg m], shape (7, 3), the tool's included.
        residual: rms of torque that they leave unexplained [N m].
        rank: directions of gravity that the poses showed.
        foot: name of the foot that was fitted.
        tool: what hung on the plate.
        measured_utc: when.
        is_simulated: the arm was a simulated one.
        poses: joint positions at which was measured [rad], shape (n, 7).
        torques: what held the arm there [N m], shape (n, 7).
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


class _BodyTable(TomlTable):
    mass: Number
    com: _Vector
    inertia: tuple[_Vector, _Vector, _Vector]


class _ToolTable(TomlTable):
    """What `tool_metadata` gives."""

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
    )


def fits_tool(calibration: GravityCalibration, tool: Tool) -> bool:
    """Return whether `tool` weighs what the tool of the calibration weighed."""
    pairs = (
        (calibration.tool.sensor, tool.sensor),
        (calibration.tool.foot, tool.foot),
    )
    return all(_weighs_the_same(theirs, ours) for theirs, ours in pairs)


def _weighs_the_same(one: Body, other: Body) -> bool:
    is_near = np.abs(one.com - other.com) <= _SAME
    return abs(one.mass - other.mass) <= _SAME and bool(is_near.all())
