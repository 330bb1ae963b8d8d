"""Identity check: was every file in use measured on this arm? By serial numbers."""

from acquisition.errors import IDLE_ARM, PreflightError, SettingsError
from experiments.operator.console import BAD, GOOD, AddLine
from experiments.rig.rig import Rig
from wam.calibration.arm_identity import check_same_arm
from wam.calibration.friction_file import friction_from_toml
from wam.calibration.gravity_file import gravity_from_toml
from wam.driver.startup import ArmInfo


def serial_numbers(rig: Rig, info: ArmInfo) -> tuple[int, ...] | None:
    """Return the serial numbers of a real arm's pucks; None = incomplete."""
    read = [puck.serial for puck in info.pucks]
    serials = tuple(serial for serial in read if serial is not None)
    return None if rig.is_simulated or len(serials) < len(read) else serials


def measured_on(rig: Rig) -> dict[str, tuple[int, ...] | None]:
    """Return the serial numbers that each file or setting in use was measured with.

    Raises:
        SettingsError: a calibration is invalid.
    """
    settings, texts = rig.settings.rig, rig.calibrations
    noted: dict[str, tuple[int, ...] | None] = {}
    if settings.arm.mech_at_home is not None:
        noted["mech_at_home of rig.toml"] = settings.arm.serial_numbers
    if settings.gravity.model == "calibrated":
        gravity = gravity_from_toml(texts.gravity, settings.gravity.file)
        noted[settings.gravity.file] = gravity.arm
    if settings.friction.model == "calibrated":
        friction = friction_from_toml(texts.friction, settings.friction.file)
        noted[settings.friction.file] = friction.arm
    return noted


def check_identity(rig: Rig, add: AddLine) -> None:
    """Compare the serial numbers of this arm with those in its files.

    Raises:
        PreflightError: a file was measured on another arm.
    """
    if rig.serials is None:
        return
    for name, noted in measured_on(rig).items():
        try:
            check_same_arm(name, noted, rig.serials)
        except SettingsError as error:
            add(BAD, "identity", error.message)
            raise PreflightError(
                error.message, hint=error.hint, arm_state=IDLE_ARM
            ) from error
    add(GOOD, "identity", f"pucks {' '.join(map(str, rig.serials))}")
