"""A gravity calibration as TOML: first moments, how well they fit, what was fitted."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from acquisition.settings import parse_toml
from wam.model.constants import Array, Body
from wam.model.tool import Tool, tool_metadata, tool_of

_SAME = 1e-9  # kg and m: the tool of a calibration and of a session
_LARGEST_MOMENT = 10.0  # kg m; a Barrett arm's largest is 3


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


def gravity_to_toml(calibration: GravityCalibration) -> str:
    """Return the text of a calibration file."""
    fields = tool_metadata(calibration.tool)
    sections = "".join(
        f"\n[tool.{name}]\n"
        f"mass = {float(body['mass'])!r}\n"
        f"com = {body['com']}\n"
        f"inertia = {body['inertia']}\n"
        for name in ("sensor", "foot")
        for body in (fields[name],)
    )
    plain = "".join(
        f"{name} = {value}\n"
        for name, value in fields.items()
        if not isinstance(value, dict)
    )
    return (
        "# Gravity of this arm with this tool. SI units, frames 1..7.\n"
        f'foot = "{calibration.foot}"\n'
        f'measured_utc = "{calibration.measured_utc}"\n'
        f"is_simulated = {str(calibration.is_simulated).lower()}\n"
        f"residual = {calibration.residual!r}\n"
        f"rank = {calibration.rank}\n"
        f"mus = {_rows(calibration.mus)}\n"
        f"poses = {_rows(calibration.poses)}\n"
        f"torques = {_rows(calibration.torques)}\n"
        f"\n[tool]\n{plain}{sections}"
    )


def gravity_from_toml(text: str, name: str) -> GravityCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is not a gravity calibration.
    """
    try:
        table = parse_toml(text)
        if not isinstance(table["is_simulated"], bool):
            raise TypeError("is_simulated is neither true nor false")
        poses = _numbers(table["poses"], (len(table["poses"]), 7))
        mus = _numbers(table["mus"], (7, 3))
        if np.abs(mus).max() > _LARGEST_MOMENT:
            raise ValueError(f"a moment exceeds {_LARGEST_MOMENT} kg m")
        return GravityCalibration(
            mus=mus,
            residual=float(_numbers(table["residual"], ())),
            rank=int(table["rank"]),
            foot=str(table["foot"]),
            tool=_tool(table["tool"]),
            measured_utc=str(table["measured_utc"]),
            is_simulated=table["is_simulated"],
            poses=poses,
            torques=_numbers(table["torques"], poses.shape),
        )
    except KeyError as error:
        raise _wrong(name, f"{error.args[0]} is missing") from error
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise _wrong(name, str(error)) from error


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


def _tool(fields: dict[str, Any]) -> Tool:
    """Return the tool of a file; its numbers are checked, it may say anything."""
    for body in (fields["sensor"], fields["foot"]):
        _numbers(body["mass"], ())
        _numbers(body["com"], (3,))
        _numbers(body["inertia"], (3, 3))
    _numbers(fields["sole"], (3,))
    for name in ("sensor_height", "sensor_angle", "sensor_sign"):
        _numbers(fields[name], ())
    return tool_of(fields)


def _numbers(value: object, shape: tuple[int, ...]) -> Array:
    array = np.array(value, dtype=np.float64)
    if array.shape != shape or not bool(np.isfinite(array).all()):
        raise ValueError(f"expected finite numbers of shape {shape}")
    return array


def _rows(values: Array) -> str:
    return "[\n" + "".join(f"  {row},\n" for row in values.tolist()) + "]"


def _wrong(name: str, what: str) -> SettingsError:
    return SettingsError(
        f"{name} is not a gravity calibration: {what}.",
        hint="Make one with: traction calibrate gravity. Nothing was started.",
    )
