"""Calibrations of the control law: [gravity] and [friction] of rig.toml, and files."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import SettingsError
from acquisition.settings import read_text
from experiments.rig.build import LawParts, build_tool
from experiments.settings.calibrations import (
    NOTHING,
    check_kind,
    fault_of,
    forced_words,
    read_calibration,
    unfit,
)
from experiments.settings.load import Settings
from experiments.settings.rig import RigSettings
from wam.calibration.friction_file import FrictionCalibration, friction_from_toml
from wam.calibration.friction_fit import check_friction
from wam.calibration.gravity_file import (
    GravityCalibration,
    check_gravity,
    fits_tool,
    gravity_from_toml,
)
from wam.control.friction_compensation import FrictionCompensation, friction_lower_bound
from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants, load_constants
from wam.model.friction import MotorFriction, joint_coulomb
from wam.model.gravity import gravity_model

_INSTEAD = 'set [gravity] model = "cad" in rig.toml'
_WITHOUT = 'set [friction] model = "none" in rig.toml'
_LARGEST = 2.5  # multiple of the friction identified on another arm


@dataclass(frozen=True, slots=True)
class LawCalibrations:
    """Texts of the calibrations in use.

    Attributes:
        gravity: text of the gravity calibration; "" for none.
        friction: text of the friction calibration, compensated or not; "" for none.
    """

    gravity: str = ""
    friction: str = ""

    def attachments(self) -> dict[str, str]:
        """Return the texts as files of a recording, by name."""
        files = {"gravity.toml": self.gravity, "friction.toml": self.friction}
        return {name: text for name, text in files.items() if text}


def gravity_path(settings: Settings) -> Path:
    """Return the path of the gravity calibration."""
    return settings.folder / settings.rig.gravity.file


def friction_path(settings: Settings) -> Path:
    """Return the path of the friction calibration."""
    return settings.folder / settings.rig.friction.file


def read_law_calibrations(settings: Settings) -> LawCalibrations:
    """Read the calibrations that rig.toml selects.

    A friction calibration that is not selected is read too, if present: its
        uncompensated
    friction is recorded.

    Raises:
        SettingsError: a selected file cannot be read.
    """
    gravity = friction = ""
    if settings.rig.gravity.model == "calibrated":
        gravity = read_calibration(gravity_path(settings), "gravity", _INSTEAD)
    if settings.rig.friction.model == "calibrated":
        friction = read_calibration(friction_path(settings), "friction", _WITHOUT)
    else:
        friction = _text_of(friction_path(settings))
    return LawCalibrations(gravity, friction)


def _text_of(path: Path) -> str:
    """Return the text of an optional file, "" if it cannot be read."""
    with suppress(OSError, ValueError):
        return read_text(path)
    return ""


def build_law_model(
    rig: RigSettings, gravity_text: str, foot: str, *, is_simulated: bool
) -> ArmModel:
    """Return the gravity model of the control law, with `foot`.

    A calibration includes the foot that was mounted; for another foot of rig.toml it is
    corrected by the difference of both. If the numbers of the calibrated foot or sensor
    have changed since, the calibration is refused: which number is wrong is not
    observable.

    Raises:
        SettingsError: the calibration is invalid, was made with another tool, or with a
            simulated arm for a real one or vice versa.
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
    fault = gravity_fault(stored)
    if fault and not stored.is_forced:
        raise unfit(rig.gravity.file, fault, "gravity", _INSTEAD)
    return gravity_model(constants, tool, stored.mus, stored.tool)


def build_law(
    rig: RigSettings,
    calibrations: LawCalibrations,
    foot: str,
    *,
    is_simulated: bool,
) -> LawParts:
    """Return models and compensation of the control law with `foot` on the arm.

    Raises:
        SettingsError: a calibration is invalid, was made with another tool or gravity,
            or with a simulated arm for a real one or vice versa.
    """
    return LawParts(
        ArmModel(load_constants(), build_tool(rig, foot)),
        build_law_model(rig, calibrations.gravity, foot, is_simulated=is_simulated),
        build_compensation(rig, calibrations.friction, is_simulated=is_simulated),
    )


def build_compensation(
    rig: RigSettings, friction_text: str, *, is_simulated: bool
) -> FrictionCompensation | None:
    """Return the friction compensation; None if rig.toml has none.

    Raises:
        SettingsError: the calibration is invalid, was made with another gravity, or
            with a simulated arm for a real one or vice versa.
    """
    section = rig.friction
    if section.model == "none":
        return None
    stored = friction_from_toml(friction_text, section.file)
    check_kind(
        section.file,
        is_of_simulation=stored.is_simulated,
        is_simulated=is_simulated,
        instead=_WITHOUT,
    )
    if stored.gravity != rig.gravity.model:
        raise SettingsError(
            f"{section.file} was measured with gravity {stored.gravity}, rig.toml has "
            f"{rig.gravity.model}: a gravity error would be identified as friction.",
            hint=f"Run traction calibrate friction again, or {_WITHOUT}. {NOTHING}",
        )
    constants, fit = load_constants(), stored.fit
    fault = friction_fault(stored)
    if fault and not stored.is_forced:
        raise unfit(section.file, fault, "friction", _WITHOUT)
    _check_size(section.file, constants, fit.friction)
    bound = friction_lower_bound(fit.friction, fit.deviation, fit.asymmetry_deviation)
    return FrictionCompensation(constants, bound, section.compensation)


def gravity_fault(stored: GravityCalibration) -> str:
    """Return why "traction calibrate gravity" would refuse the fit, "" if not."""
    return fault_of(lambda: check_gravity(load_constants(), stored))


def friction_fault(stored: FrictionCalibration) -> str:
    """Return why "traction calibrate friction" would refuse the fit, "" if not."""
    return fault_of(lambda: check_friction(stored.fit))


def forced_calibrations(settings: Settings, calibrations: LawCalibrations) -> list[str]:
    """Return a sentence for each calibration in use that was forced.

    Raises:
        SettingsError: a calibration is invalid.
    """
    rig, words = settings.rig, forced_words(settings)
    if rig.gravity.model == "calibrated":
        gravity = gravity_from_toml(calibrations.gravity, rig.gravity.file)
        if fault := gravity_fault(gravity):
            words.append(f"{rig.gravity.file} was forced. {fault}")
    if rig.friction.model == "calibrated":
        friction = friction_from_toml(calibrations.friction, rig.friction.file)
        if fault := friction_fault(friction):
            words.append(f"{rig.friction.file} was forced. {fault}")
    return words


def _check_size(name: str, constants: ArmConstants, friction: MotorFriction) -> None:
    """Refuse implausibly large friction: its compensation would drive the arm."""
    coulomb = joint_coulomb(constants, friction.coulomb)
    limits = _LARGEST * constants.coulomb
    for joint, (torque, limit) in enumerate(zip(coulomb, limits, strict=True), 1):
        if torque > limit:
            raise SettingsError(
                f"{name} gives {torque:.2f} N m of friction at joint {joint}, more "
                f"than {limit:.2f} N m.",
                hint=f"Run traction calibrate friction again, or {_WITHOUT}. {NOTHING}",
            )


def law_words(rig: RigSettings, calibrations: LawCalibrations, foot: str) -> str:
    """Describe gravity and friction model, for a session with `foot`."""
    weight = f"gravity {gravity_words(rig, calibrations.gravity, foot)}"
    if rig.friction.model == "none":
        return f"{weight}, friction not compensated"
    stored = friction_from_toml(calibrations.friction, rig.friction.file)
    share = f"{rig.friction.share:.0%} taken off"
    return f"{weight}, friction calibrated {stored.measured_utc}, {share}"


def gravity_words(rig: RigSettings, gravity_text: str, foot: str) -> str:
    """Describe the gravity model, for a session with `foot`."""
    if rig.gravity.model != "calibrated":
        return rig.gravity.model
    stored = gravity_from_toml(gravity_text, rig.gravity.file)
    moved = "" if stored.foot == foot else f", corrected from {stored.foot} to {foot}"
    return f"calibrated {stored.measured_utc}, rms {stored.residual:.2f} N m{moved}"


def _check_tool(rig: RigSettings, stored: GravityCalibration) -> None:
    is_known = stored.foot in rig.feet
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
