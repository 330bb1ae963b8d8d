"""Values of rig.toml that C5 to C7 measured otherwise: offered, never taken by itself.

An offer is made where a value differs by more than half of what its step lets pass, an
angle also by more than twice the standard deviation of the fit. Of several angles the
largest is offered: the others may follow from it. Who signs the record accepts the
values as they stand.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from experiments.commissioning.steps import ProofStep
from experiments.proving.fits import FITTED, fit_foot, fit_hung
from experiments.proving.limits import LIMITS
from experiments.proving.recording import Values, number
from wam.model.constants import Array

_SHARE = 0.5  # of a limit, from which on a value is offered
_SPREADS = 2.0  # of the fit
_REMEDIES = {  # of angles that rig.toml has no value for
    "the base about x": "Level the base (shims), or accept it.",
    "the base about y": "Level the base (shims), or accept it.",
    "the sensor about x": "Look for dirt under its flange, or accept it.",
    "the sensor about y": "Look for dirt under its flange, or accept it.",
}


@dataclass(frozen=True, slots=True)
class Mounted:
    """Where rig.toml has the sensor.

    Attributes:
        foot: name of the foot that is fitted, as in [feet].
        height: of the sensor's origin above the tool plate [m].
        angle: of the sensor about z7 [rad].
    """

    foot: str
    height: float
    angle: float


def offers_of(recordings: Mapping[ProofStep, Values], mounted: Mounted) -> list[str]:
    """Return what is offered, a sentence each, in the order of the steps.

    Args:
        recordings: of the steps that were done.
        mounted: where rig.toml has the sensor.
    """
    offered: list[str] = []
    if (own := recordings.get(ProofStep.OWN_WEIGHT)) is not None:
        offered += _of_foot(own, mounted)
    if (hung := recordings.get(ProofStep.HUNG_WEIGHT)) is not None:
        offered += _of_hung(hung, mounted)
    return offered


def _of_foot(values: Values, mounted: Mounted) -> Iterator[str]:
    fit, mass = fit_foot(values), number(values, "mass")
    if abs(fit.mass / mass - 1.0) > _half("foot_mass") / 100.0:
        yield (
            f"The foot weighs {fit.mass:.3f} kg, rig.toml says {mass:.3f}: weigh it, "
            f"then feet.{mounted.foot}.mass = {fit.mass:.3f}, or accept it."
        )
    if np.linalg.norm(fit.centre - values["centre"]) > _half("foot_centre") / 1e3:
        centre = _in_frame_7(fit.centre, mounted)
        yield (
            "The foot's centre of mass lies elsewhere than rig.toml says: "
            f"feet.{mounted.foot}.com = {_vector(centre)}, or accept it."
        )


def _of_hung(values: Values, mounted: Mounted) -> Iterator[str]:
    fit = fit_hung(values)
    scale = float(np.median(fit.scale))
    if abs(scale - 1.0) > _half("hung_scale", about=1.0):
        yield (
            f"The sensor shows {scale:.3f} of a known weight: compare its "
            "calibration sheet, or traction calibrate sensor, or accept it."
        )
    if np.linalg.norm(fit.sole - values["sole"]) > _half("sole") / 1e3:
        sole = _in_frame_7(fit.sole, mounted)
        yield (
            "The string pulls elsewhere than at the sole of rig.toml: "
            f"feet.{mounted.foot}.sole = {_vector(sole)} if it was in its middle."
        )
    least = max(np.radians(_half("fitted")), _SPREADS * fit.spreads[fit.worst])
    if abs(fit.angles[fit.worst]) > least:
        yield _of_angle(FITTED[fit.worst], fit.worst_angle, fit.worst_spread, mounted)


def _of_angle(name: str, angle: float, spread: float, mounted: Mounted) -> str:
    off = f"{abs(np.degrees(angle)):.1f} ± {np.degrees(spread):.1f} degrees"
    if name.startswith("the zero of "):
        joint = name.removeprefix("the zero of ")
        more = "more" if angle > 0.0 else "less"
        return (
            f"At home {joint} tells {off} {more} than it should: lay the arm home "
            "and zero again (traction zero), or accept it."
        )
    if name == "the sensor about z":
        value = np.degrees(mounted.angle + angle)
        return (
            f"The sensor is turned {off} about z7 beside rig.toml: "
            f"ft_sensor.angle_deg = {value:.1f}, or accept it."
        )
    return f"{name[0].upper()}{name[1:]} stands {off} off. {_REMEDIES[name]}"


def _in_frame_7(place: Array, mounted: Mounted) -> Array:
    """Return a place in the sensor frame [m] as rig.toml gives it, shape (3,)."""
    c, s = np.cos(mounted.angle), np.sin(mounted.angle)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ place
    return turned + np.array([0.0, 0.0, mounted.height])


def _half(key: str, about: float = 0.0) -> float:
    """Return the share of a limit from which on a value is offered, in its unit."""
    high = LIMITS[key].high
    assert high is not None
    return _SHARE * (high - about)


def _vector(place: Array) -> str:
    return f"[{', '.join(f'{each:.4f}' for each in place)}]"
