"""A calibration of the wrist sensor as TOML: payload, mounting, bias, what was read."""

from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from acquisition.settings import parse_toml
from ft_sensor.calibration.fit import Floats, SensorFit
from wam.model.constants import Array

_HEAVIEST = 5.0  # kg; what a wrist sensor carries
_MOST = 200  # orientations


@dataclass(frozen=True, slots=True)
class SensorCalibration:
    """What one foot weighs on one sensor, and how the sensor is mounted.

    Attributes:
        fit: payload, mounting and bias.
        foot: name of the foot that was on.
        drift: how much the force in the first orientation had changed at the end [N].
        measured_utc: when.
        is_simulated: the sensor was a simulated one.
        rotations: orientations of frame 7 in the base frame, shape (n, 3, 3).
        readings: mean raw readings there [N, N m], shape (n, 6).
    """

    fit: SensorFit
    foot: str
    drift: float
    measured_utc: str
    is_simulated: bool
    rotations: Floats
    readings: Floats

    def com_in_frame_7(self, height: float) -> Array:
        """Return the payload's centre in frame 7 [m], shape (3,).

        Args:
            height: origin of the sensor frame above the tool plate [m].
        """
        x, y, z = self.fit.com.tolist()
        c, s = np.cos(self.fit.angle), np.sin(self.fit.angle)
        return np.array([c * x - s * y, s * x + c * y, z + height])


def sensor_to_toml(calibration: SensorCalibration) -> str:
    """Return the text of a calibration file."""
    fit = calibration.fit
    rotations = calibration.rotations.reshape(-1, 9).tolist()
    return (
        "# Wrist sensor and foot. SI units, sensor frame; angle: about z of frame 7.\n"
        f'foot = "{calibration.foot}"\n'
        f'measured_utc = "{calibration.measured_utc}"\n'
        f"is_simulated = {str(calibration.is_simulated).lower()}\n"
        f"mass = {fit.mass!r}\n"
        f"com = {fit.com.tolist()}\n"
        f"angle = {fit.angle!r}\n"
        f"sign = {fit.sign!r}\n"
        f"bias = {fit.bias.tolist()}\n"
        f"residual = {fit.residual!r}\n"
        f"torque_residual = {fit.torque_residual!r}\n"
        f"drift = {calibration.drift!r}\n"
        f"rotations = {_rows(rotations)}\n"
        f"readings = {_rows(calibration.readings.tolist())}\n"
    )


def sensor_from_toml(text: str, name: str) -> SensorCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is not a calibration of a wrist sensor.
    """
    try:
        table = parse_toml(text)
        if not isinstance(table["is_simulated"], bool):
            raise TypeError("is_simulated is neither true nor false")
        count = len(table["rotations"])
        if count > _MOST:
            raise ValueError(f"more than {_MOST} orientations")
        fit = SensorFit(
            mass=_number(table["mass"], 0.0, _HEAVIEST),
            com=_array(table["com"], (3,)),
            bias=_array(table["bias"], (6,)),
            angle=_number(table["angle"], -2 * np.pi, 2 * np.pi),
            sign=1.0 if _number(table["sign"], -1.0, 1.0) > 0 else -1.0,
            residual=_number(table["residual"], 0.0, 1e6),
            torque_residual=_number(table["torque_residual"], 0.0, 1e6),
        )
        return SensorCalibration(
            fit=fit,
            foot=str(table["foot"]),
            drift=_number(table["drift"], 0.0, 1e6),
            measured_utc=str(table["measured_utc"]),
            is_simulated=table["is_simulated"],
            rotations=_array(table["rotations"], (count, 9)).reshape(count, 3, 3),
            readings=_array(table["readings"], (count, 6)),
        )
    except KeyError as error:
        raise _wrong(name, f"{error.args[0]} is missing") from error
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise _wrong(name, str(error)) from error


def _number(value: object, least: float, most: float) -> float:
    number = float(_array(value, ()))
    if not least <= number <= most:
        raise ValueError(f"{number} is not within {least:g}..{most:g}")
    return number


def _array(value: object, shape: tuple[int, ...]) -> Array:
    array = np.array(value, dtype=np.float64)
    if array.shape != shape or not bool(np.isfinite(array).all()):
        raise ValueError(f"expected finite numbers of shape {shape}")
    return array


def _rows(values: list[list[float]]) -> str:
    return "[\n" + "".join(f"  {row},\n" for row in values) + "]"


def _wrong(name: str, what: str) -> SettingsError:
    return SettingsError(
        f"{name} is not a calibration of a wrist sensor: {what}.",
        hint="Make one with: traction calibrate sensor. Nothing was started.",
    )
