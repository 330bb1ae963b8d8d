"""Which gravity floats the arm: [gravity] of rig.toml and the file behind it."""

from pathlib import Path

from acquisition import SettingsError
from experiments.rig.build import build_tool
from experiments.settings import (
    NOTHING,
    RigSettings,
    Settings,
    check_kind,
    read_calibration,
)
from wam.calibration import GravityCalibration, fits_tool, gravity_from_toml
from wam.model import ArmModel, gravity_model, load_constants

_INSTEAD = 'set [gravity] model = "cad" in rig.toml'


def gravity_path(settings: Settings) -> Path:
    """Return where rig.toml has its gravity calibration, from its own folder."""
    return settings.folder / settings.rig.gravity.file


def read_gravity(settings: Settings) -> str:
    """Return the text of the calibration that rig.toml chooses; "" for none.

    Raises:
        SettingsError: it cannot be read.
    """
    if settings.rig.gravity.model != "calibrated":
        return ""
    return read_calibration(gravity_path(settings), "gravity", _INSTEAD)


def build_law_model(
    rig: RigSettings, gravity_text: str, foot: str, *, is_simulated: bool
) -> ArmModel:
    """Return the arm with `foot` on it as the control law weighs it.

    A calibration contains the foot that was on. For another foot of rig.toml it is
    corrected by the difference of the two. A foot or sensor whose numbers have changed
    since is none that was fitted: which of them is wrong is not observable, so it is
    refused.

    Raises:
        SettingsError: the calibration is none, was made with another tool, or with a
            simulated arm for a real one or conversely.
    """
    constants, tool = load_constants(), build_tool(rig, foot)
    if rig.gravity.model == "cad":
        return ArmModel(constants, tool)
    if rig.gravity.model == "shipped":
        return gravity_model(constants, tool, constants.mus)
    stored = gravity_from_toml(gravity_text, rig.gravity.file)
    check_kind(
        rig.gravity.file,
        is_of_simulation=stored.is_simulated,
        is_simulated=is_simulated,
        instead=_INSTEAD,
    )
    _check_tool(rig, stored)
    return gravity_model(constants, tool, stored.mus, stored.tool)


def gravity_words(rig: RigSettings, gravity_text: str, foot: str) -> str:
    """Return the choice in words, for a session with `foot`."""
    if rig.gravity.model != "calibrated":
        return rig.gravity.model
    stored = gravity_from_toml(gravity_text, rig.gravity.file)
    moved = "" if stored.foot == foot else f", corrected from {stored.foot} to {foot}"
    return f"calibrated {stored.measured_utc}, rms {stored.residual:.2f} N m{moved}"


def _check_tool(rig: RigSettings, stored: GravityCalibration) -> None:
    is_known = stored.foot in type(rig.feet).model_fields
    if is_known and fits_tool(stored, build_tool(rig, stored.foot)):
        return
    sensor, body = stored.tool.sensor, stored.tool.foot
    raise SettingsError(
        f"{rig.gravity.file} was measured with another tool: foot {stored.foot} of "
        f"{body.mass:.3f} kg at {body.com.tolist()}, sensor of {sensor.mass:.3f} kg; "
        "rig.toml says otherwise.",
        hint="Run traction calibrate gravity again, or set [gravity] model = "
        f'"cad" in rig.toml. {NOTHING}',
    )
