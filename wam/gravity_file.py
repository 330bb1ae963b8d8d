"""A gravity calibration as TOML: first moments, how well they fit, what was fitted."""

import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from wam.constants import Array
from wam.tool import Tool, tool_facts

_SAME = 1e-9  # kg and m: the tool of a calibration and of a session


@dataclass(frozen=True, slots=True)
class GravityCalibration:
    """First moments of an arm with a tool, as measured.

    Attributes:
        mus: first moments [kg m], shape (7, 3), the tool's included.
        residual: rms of torque that they leave unexplained [N m].
        rank: directions of gravity that the poses showed.
        foot: name of the foot that was fitted.
        tool: what hung on the plate, as `wam.tool.tool_facts` puts it.
        measured_utc: when.
        poses: joint positions at which was measured [rad], shape (n, 7).
    """

    mus: Array
    residual: float
    rank: int
    foot: str
    tool: dict[str, Any]
    measured_utc: str
    poses: Array


def gravity_to_toml(calibration: GravityCalibration) -> str:
    """Return the text of a calibration file."""
    rows = "".join(f"  {row},\n" for row in calibration.mus.tolist())
    poses = "".join(f"  {row},\n" for row in calibration.poses.tolist())
    sections = "".join(
        f"\n[tool.{name}]\n"
        f"mass = {float(body['mass'])!r}\n"
        f"com = {body['com']}\n"
        f"inertia = {body['inertia']}\n"
        for name in ("sensor", "foot")
        for body in (calibration.tool[name],)
    )
    plain = "".join(
        f"{name} = {value}\n"
        for name, value in calibration.tool.items()
        if not isinstance(value, dict)
    )
    return (
        "# Gravity of this arm with this tool. SI units, frames 1..7.\n"
        f'foot = "{calibration.foot}"\n'
        f'measured_utc = "{calibration.measured_utc}"\n'
        f"residual = {calibration.residual!r}\n"
        f"rank = {calibration.rank}\n"
        f"mus = [\n{rows}]\n"
        f"poses = [\n{poses}]\n"
        f"\n[tool]\n{plain}{sections}"
    )


def gravity_from_toml(text: str, name: str) -> GravityCalibration:
    """Return the calibration of a file called `name`.

    Raises:
        SettingsError: the text is no gravity calibration.
    """
    try:
        table = tomllib.loads(text)
        mus, poses = np.array(table["mus"], float), np.array(table["poses"], float)
        if mus.shape != (7, 3) or poses.ndim != 2 or poses.shape[1] != 7:
            raise ValueError(
                f"mus {mus.shape} or poses {poses.shape} has a wrong shape"
            )
        if not (np.isfinite(mus).all() and np.isfinite(poses).all()):
            raise ValueError("a number is not finite")
        return GravityCalibration(
            mus=mus,
            residual=float(table["residual"]),
            rank=int(table["rank"]),
            foot=str(table["foot"]),
            tool=dict(table["tool"]),
            measured_utc=str(table["measured_utc"]),
            poses=poses,
        )
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError) as error:
        raise SettingsError(
            f"{name} is no gravity calibration: {error}.",
            hint="Make one with: traction calibrate gravity. Nothing was started.",
        ) from error


def fits_tool(calibration: GravityCalibration, tool: Tool) -> bool:
    """Return whether `tool` weighs what the tool of the calibration weighed."""
    wanted = tool_facts(tool)
    for name in ("sensor", "foot"):
        theirs, ours = calibration.tool.get(name), wanted[name]
        if not isinstance(theirs, dict):
            return False
        try:
            found = np.array([theirs["mass"], *theirs["com"]], float)
        except (KeyError, TypeError, ValueError):
            return False
        expected = np.array([ours["mass"], *ours["com"]])
        if found.shape != (4,) or not np.allclose(found, expected, atol=_SAME):
            return False
    return True
