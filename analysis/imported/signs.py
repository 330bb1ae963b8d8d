"""Whether a force can be that of the ground: its signs while the foot is pressed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.plausibility import FEWEST, SLOWEST
from analysis.data.series import Array

_PRESSED = 2.0  # N
LEAST_PRESSING = 0.95  # share of pressed samples with F_n > 0
LEAST_BRAKING = 0.80  # share of sliding samples with F_t v_t > 0
MOST_ASIDE = 1.0  # of the force along the way


@dataclass(frozen=True, slots=True)
class Check:
    """One check of the signs.

    Attributes:
        name: what was looked at.
        value: what was found.
        limit: what it may be at least or at most, in words.
    """

    name: str
    value: float
    limit: str


def sign_checks(values: Array, lateral: Array) -> list[Check]:
    """Return what the signs of the forces are.

    Args:
        values: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
        lateral: force across the way [N], shape (n,).

    Raises:
        SettingsError: the force cannot be that of the ground on the foot.
    """
    v_t, F_t, F_n = values.T
    size = np.sqrt(F_t**2 + F_n**2 + lateral**2)
    pressed = size > _PRESSED
    sliding = pressed & (np.abs(v_t) > SLOWEST)
    if np.count_nonzero(sliding) < FEWEST:
        raise SettingsError(
            f"The pressed foot slides in {np.count_nonzero(sliding)} rows only (limit "
            f"{FEWEST}).",
            hint="Check the log: is the foot pushed over the ground in it?",
        )
    pressing = float(np.mean(F_n[pressed] > 0.0))
    braking = float(np.mean((F_t * v_t)[sliding] > 0.0))
    aside, along = (float(np.median(np.abs(x[sliding]))) for x in (lateral, F_t))
    said = (
        f"F_n > 0 in {pressing:.0%} of the pressed rows (limit {LEAST_PRESSING:.0%}), "
        f"F_t against the motion in {braking:.0%} of the sliding ones (limit "
        f"{LEAST_BRAKING:.0%})"
    )
    is_pressing, is_braking = pressing >= LEAST_PRESSING, braking >= LEAST_BRAKING
    if pressing < 1.0 - LEAST_PRESSING and braking < 1.0 - LEAST_BRAKING:
        raise SettingsError(
            f"The wrench has the other sign: {said}.",
            hint="Give the other --acts; or is --sensor another frame?",
        )
    if not (is_pressing and is_braking):
        raise SettingsError(
            f"The axes of the wrench are not those of the sensor's frame: {said}.",
            hint="Check --sensor, the URDF, --normal and --along, and the tare.",
        )
    if aside > MOST_ASIDE * along:
        raise SettingsError(
            f"The axes of the wrench are not those of the sensor's frame: "
            f"{aside:.1f} N across the way, {along:.1f} N along it.",
            hint="Check --sensor, the URDF and --along.",
        )
    return [
        Check("F_n > 0 while pressed", pressing, f">= {LEAST_PRESSING:g}"),
        Check("F_t against the motion", braking, f">= {LEAST_BRAKING:g}"),
        Check("force across over along", aside / along, f"<= {MOST_ASIDE:g}"),
    ]
