"""Checks that a force can come from the ground: its signs while the foot is pressed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.plausibility import (
    FEWEST,
    HEADING,
    SHORTEST,
    SLOWEST,
    UNEVEN,
)
from analysis.data.series import Array

PRESSED_FORCE = 2.0  # N below which a foot is in the air
LEAST_PRESSING = 0.95  # least share of pressed samples with F_n > 0
LEAST_BRAKING = 0.80  # least share of sliding samples with F_t v_t > 0
USUAL_ASIDE = 0.3  # lateral over traction force above which a warning is given
_LEAST_MOMENT = 0.02  # N m rms
_MIRRORED = -0.3  # gain of the moments below which axes are mirrored
MOST_ASIDE = 1.0  # lateral over traction force above which the log is refused


@dataclass(frozen=True, slots=True)
class SignFigure:
    """One criterion for the signs of the forces.

    Attributes:
        name: name of the criterion.
        value: measured value.
        limit: lower or upper limit in words.
    """

    name: str
    value: float
    limit: str


def side_warnings(values: Array, lateral: Array) -> list[str]:
    """Warn if the lateral force indicates a rotated sensor.

    Args:
        values: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
        lateral: lateral force [N], shape (n,).
    """
    v_t, F_t, F_n = values.T
    sliding = (F_n > PRESSED_FORCE) & (v_t > SLOWEST)
    if not sliding.any():
        return []
    aside, along = float(np.median(lateral[sliding])), float(np.median(F_t[sliding]))
    if abs(aside) <= USUAL_ASIDE * along:
        return []
    angle = float(np.degrees(np.arctan2(aside, along)))
    return [
        f"{aside:+z.1f} N across the path, {along:.1f} N along it: are axes exchanged, "
        f"or is the sensor turned by {angle:+z.0f} degrees about the normal? Check "
        "--sensor, the URDF and --along"
    ]


def moment_warnings(moment: Array, lever: Array, force: Array) -> list[str]:
    """Warn if the moments indicate mirrored axes.

    A force at the foot has the moment r x F about the sensor's origin. Exchanging two
    axes is a reflection: forces may still look right, but moments change sign.

    Args:
        moment: moment of the ground about the sensor's origin [N m], shape (n, 3).
        lever: vector from there to the foot, same axes [m], shape (n, 3).
        force: force of the ground, same axes [N], shape (n, 3).
    """
    expected = np.cross(lever, force)
    sound = np.isfinite(expected).all(axis=1) & np.isfinite(moment).all(axis=1)
    sound &= np.linalg.norm(force, axis=1) > PRESSED_FORCE
    power = float(np.sum(expected[sound] ** 2))
    if not sound.any() or power < np.count_nonzero(sound) * _LEAST_MOMENT**2:
        return []
    gain = float(np.sum(moment[sound] * expected[sound])) / power
    if gain >= _MIRRORED:
        return []
    return [
        f"the moments are {gain:.1f} times those of a force at the foot: are two axes "
        "of the wrench exchanged, have moments the other sign, or is the sole another "
        "link? Check --sensor, --foot and the URDF"
    ]


def path_warnings(trial: str, path: Array, axes: Array) -> list[str]:
    """Warn if the path of a stroke deviates from the stated direction.

    Args:
        trial: its name.
        path: positions of the pressed foot in one stroke [m], shape (n, 3).
        axes: rows x_T, y_T, z_T, shape (3, 3).
    """
    ahead, aside, _ = ((path - path[0]) @ axes.T).T
    length = float(np.ptp(ahead))
    if length < SHORTEST:
        return []
    angle = float(np.degrees(np.arctan(np.polyfit(ahead, aside, 1)[0])))
    deviation = length * np.tan(np.radians(abs(angle)))
    if abs(angle) <= HEADING or deviation <= UNEVEN:
        return []
    return [
        f"{trial}: the foot's path is {angle:+z.1f} degrees off --along (limit "
        f"{HEADING:g})"
    ]


def sign_figures(values: Array, lateral: Array) -> list[SignFigure]:
    """Check the signs of the forces in the trials.

    Args:
        values: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
        lateral: force across the path [N], shape (n,).

    Raises:
        SettingsError: the forces cannot come from ground that supports and slows the
            foot.
    """
    v_t, F_t, F_n = values.T
    size = np.sqrt(F_t**2 + F_n**2 + lateral**2)
    pressed = size > PRESSED_FORCE
    sliding = pressed & (np.abs(v_t) > SLOWEST)
    if np.count_nonzero(sliding) < FEWEST:
        most = float(np.nanmax(size)) if np.isfinite(size).any() else 0.0
        fastest = float(np.abs(v_t).max())
        raise SettingsError(
            f"In {np.count_nonzero(sliding)} rows of the trials the force is over "
            f"{PRESSED_FORCE:g} N while the foot moves (limit {FEWEST}): the largest "
            f"force is {most:.1f} N, the fastest motion {fastest * 1e3:.1f} mm/s.",
            hint="Check --trials, --wrench and --foot.",
        )
    pressing = float(np.mean(F_n[pressed] > 0.0))
    braking = float(np.mean((F_t * v_t)[sliding] > 0.0))
    aside, along = (float(np.median(np.abs(x[sliding]))) for x in (lateral, F_t))
    shares = (
        f"F_n > 0 in {pressing:.0%} of the pressed rows (limit {LEAST_PRESSING:.0%}), "
        f"F_t against the motion in {braking:.0%} of the sliding ones (limit "
        f"{LEAST_BRAKING:.0%})"
    )
    if pressing < 1.0 - LEAST_PRESSING and braking < 1.0 - LEAST_BRAKING:
        raise SettingsError(
            f"Normal and traction force have the opposite sign: {shares}.",
            hint="Give the other --acts; or is --sensor another frame?",
        )
    if not (pressing >= LEAST_PRESSING and braking >= LEAST_BRAKING):
        raise SettingsError(
            f"These forces cannot come from the ground: {shares}.",
            hint="Check the axes of the wrench: --sensor, the URDF, --normal, --along; "
            "then --acts and --tare.",
        )
    if aside > MOST_ASIDE * along:
        raise SettingsError(
            f"The force across the path is {aside:.1f} N, along it {along:.1f} N.",
            hint="Check the axes of the wrench: --sensor, the URDF and --along.",
        )
    return [
        SignFigure("F_n > 0 while pressed", pressing, f">= {LEAST_PRESSING:g}"),
        SignFigure("F_t against the motion", braking, f">= {LEAST_BRAKING:g}"),
        SignFigure("force across over along", aside / along, f"<= {MOST_ASIDE:g}"),
    ]
