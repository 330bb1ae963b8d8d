"""Wrist sensor calibration as TOML: payload, mounting, bias, readings."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from acquisition.errors import SettingsError
from acquisition.settings import Number, Six
from acquisition.toml_files import TomlFile
from acquisition.validation import Many
from ft_sensor.calibration.fit import Floats, SensorFit
from wam.model.constants import Array

_MOST = 200  # orientations
_Residual = Annotated[Number, Field(ge=0, le=1e6)]
_Nine = Annotated[tuple[Number, ...], Field(min_length=9, max_length=9)]


@dataclass(frozen=True, slots=True)
class SensorCalibration:
    """Payload of one foot on one sensor, and the sensor's mounting.

    Attributes:
        fit: payload, mounting and bias.
        foot: name of the mounted foot.
        drift: change of the force in the first orientation until the end [N].
        measured_utc: time of the measurement.
        is_simulated: the sensor was simulated.
        rotations: orientations of frame 7 in the base frame, shape (n, 3, 3).
        readings: mean raw readings [N, N m], shape (n, 6).
        is_forced: a person accepted it although `check_residual` refuses it.
    """

    fit: SensorFit
    foot: str
    drift: float
    measured_utc: str
    is_simulated: bool
    rotations: Floats
    readings: Floats
    is_forced: bool = False

    def com_in_frame_7(self, height: float) -> Array:
        """Return the payload's centre of mass in frame 7 [m], shape (3,).

        Args:
            height: height of the sensor frame above the tool plate [m].
        """
        x, y, z = self.fit.com.tolist()
        c, s = np.cos(self.fit.angle), np.sin(self.fit.angle)
        return np.array([c * x - s * y, s * x + c * y, z + height])


class _SensorFile(TomlFile):
    """The fields of `SensorCalibration`, in the order of the file."""

    foot: str
    measured_utc: str
    is_simulated: bool = Field(strict=True)
    is_forced: bool = Field(default=False, strict=True)
    mass: Number = Field(ge=0, le=5)  # kg
    com: tuple[Number, Number, Number]
    angle: Number = Field(ge=-2 * np.pi, le=2 * np.pi)
    sign: Number = Field(ge=-1, le=1)
    bias: Six
    residual: _Residual
    torque_residual: _Residual
    drift: _Residual
    rotations: Many[_Nine] = Field(min_length=1, max_length=_MOST)
    readings: Many[Six] = Field(max_length=_MOST)

    @model_validator(mode="after")
    def _has_a_reading_for_each_rotation(self) -> Self:
        if len(self.readings) != len(self.rotations):
            counts = f"{len(self.rotations)} rotations, {len(self.readings)} readings"
            raise ValueError(counts)
        return self


def sensor_to_toml(calibration: SensorCalibration) -> str:
    """Return the text of a calibration file."""
    fit = calibration.fit
    file = _SensorFile.model_construct(
        foot=calibration.foot,
        measured_utc=calibration.measured_utc,
        is_simulated=calibration.is_simulated,
        is_forced=calibration.is_forced,
        mass=fit.mass,
        com=fit.com.tolist(),
        angle=fit.angle,
        sign=fit.sign,
        bias=fit.bias.tolist(),
        residual=fit.residual,
        torque_residual=fit.torque_residual,
        drift=calibration.drift,
        rotations=calibration.rotations.reshape(-1, 9).tolist(),
        readings=calibration.readings.tolist(),
    )
    return file.text(
        "Wrist sensor and foot. SI units, sensor frame; angle: about z of frame 7."
    )


def sensor_from_toml(text: str, name: str) -> SensorCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is not a calibration of a wrist sensor.
    """
    try:
        file = _SensorFile.parse(text)
    except ValueError as error:
        raise SettingsError(
            f"{name} is not a calibration of a wrist sensor: {error}.",
            hint="Make one with: traction calibrate sensor. Nothing was started.",
        ) from error
    fit = SensorFit(
        mass=file.mass,
        com=np.array(file.com),
        bias=np.array(file.bias),
        angle=file.angle,
        sign=1.0 if file.sign > 0 else -1.0,
        residual=file.residual,
        torque_residual=file.torque_residual,
    )
    return SensorCalibration(
        fit=fit,
        foot=file.foot,
        drift=file.drift,
        measured_utc=file.measured_utc,
        is_simulated=file.is_simulated,
        rotations=np.array(file.rotations).reshape(-1, 3, 3),
        readings=np.array(file.readings),
        is_forced=file.is_forced,
    )
