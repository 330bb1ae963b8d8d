"""Files of calibrations that rig.toml and matrix.toml name: read, and of which kind."""

from pathlib import Path

from acquisition.errors import SettingsError

_LARGEST = 1_000_000  # bytes; a calibration has a few thousand
NOTHING = "Nothing was started."


def read_calibration(path: Path, what: str, instead: str) -> str:
    """Return the text of the calibration at `path`.

    Args:
        path: of the file.
        what: what is calibrated, as in "traction calibrate WHAT".
        instead: what to write into the settings to do without.

    Raises:
        SettingsError: it cannot be read.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise ValueError("it is too large")
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no calibration"
        raise SettingsError(
            f"The {what} calibration {path} cannot be read ({reason}).",
            hint=f"Make it with: traction calibrate {what}. Or {instead}. {NOTHING}",
        ) from error


def check_kind(
    name: str, *, is_of_simulation: bool, is_simulated: bool, instead: str
) -> None:
    """Refuse what was measured on a simulated rig for a real one, and conversely.

    Raises:
        SettingsError: the two do not fit.
    """
    if is_of_simulation == is_simulated:
        return
    kinds = "simulated", "real"
    theirs, ours = kinds if is_of_simulation else kinds[::-1]
    raise SettingsError(
        f"{name} was measured on a {theirs} arm, this is a {ours} one.",
        hint=f"{instead[0].upper()}{instead[1:]}, or name another file. {NOTHING}",
    )
