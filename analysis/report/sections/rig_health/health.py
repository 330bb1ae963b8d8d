"""How the rig behaved in one recorded trial, and what it could have measured."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from acquisition.sample import Flag
from analysis.data.load import RecordedTrial
from analysis.data.prepare import moving_average
from analysis.data.series import Array
from analysis.report.force_uncertainty import (
    ForceUncertainty,
    TaredTrial,
    tare_changes,
    uncertainties_of,
    uncertainty_of,
)
from ft_sensor.reading import largest_traction
from wam.calibration.friction_file import friction_from_toml
from wam.model.constants import GRAVITY

HEALTH_UNITS = {
    "period": "ms",
    "longest_gap": "ms",
    "skew": "ms",
    "tare": "N",
    "tare_bracket": "N",
    "joint7": "mrad",
    "puck_degc": "degC",
    "motor_degc": "degC",
    "largest_F_t": "N",
    "measurable_F_t": "N",
    "saturated": "1",
    "noise": "N",
    "force_uncertainty": "N",
    "floor": "N",
    "load_bias": "N",
    "drag": "N",
    "lateral": "N",
}
PERIOD_EDGES = np.append(np.arange(0.05, 8.0, 0.1), np.inf)  # ms, 2 in mid-bin
SKEW_EDGES = np.arange(-4.1, 12.2, 0.2)  # ms

_MOVING = 0.005  # m/s
_SMOOTHING = 11  # samples, as the models see the trial
_REST = 0.3  # s at the start of a trial that are at rest by the procedure
_SHORTEST = 50  # samples that the noise is taken of


@dataclass(frozen=True, slots=True)
class RigTrial:
    """One trial as the rig lived through it.

    Attributes:
        terrain: its terrain.
        name: session and trial.
        started_utc: when it began, ISO 8601; empty where that was not kept.
        cycles: recorded.
        missed: cycles that the loop could not begin in time.
        periods: cycles by length [PERIOD_EDGES], shape (bins,);
            the last bin has no end.
        period: median time from cycle to cycle [ms].
        longest_gap: longest time between cycles [ms].
        skews: cycles by the age of their force sample [SKEW_EDGES], shape (bins,).
        skew: 5 %, 50 % and 95 % of that age: joints later than force [ms].
        tare: force taken off as sensor offset [N], x y z of the sensor.
        tare_bracket: how far the next tare is from this trial's [N]; None where none
            followed.
        joint7: largest motion of the locked joint [mrad].
        puck_degc: temperatures of the pucks as last heard [degrees Celsius].
        motor_degc: temperatures of their motors.
        largest_F_t: largest traction measured [N].
        measurable_F_t: largest traction that the sensor can measure at the sole by
            its ranges [N]; None where it did not say.
        saturated: share of cycles whose force sample was out of range [-].
        noise: standard deviation of smoothed F_t at rest [N]; None without rest.
        force_uncertainty: standard uncertainty of mean F_t and F_n by the tares of the
            session [N]; None without two of them.
        floor: mean absolute error of smoothed F_t by noise and tares [N], by noise
            alone where the tares are not known; None without rest.
        load_bias: median F_n of the moving foot less the set load [N].
        drag: what the joints' Coulomb friction asks of the hand along x_T [N], by the
            recorded calibration less what was compensated, else by the figures of the
            arm model; median over the moving samples.
        lateral: mean |F_y| while moving [N].
    """

    terrain: str
    name: str
    started_utc: str
    cycles: int
    missed: int
    periods: Array
    period: float
    longest_gap: float
    skews: Array
    skew: tuple[float, float, float]
    tare: tuple[float, float, float]
    tare_bracket: float | None
    joint7: float
    puck_degc: tuple[float, ...]
    motor_degc: tuple[float, ...]
    largest_F_t: float
    measurable_F_t: float | None
    saturated: float
    noise: float | None
    force_uncertainty: float | None
    floor: float | None
    load_bias: float | None
    drag: float | None
    lateral: float | None

    @property
    def session(self) -> str:
        """Name of its session."""
        return self.name.partition("/")[0]

    def numbers(self) -> dict[str, Any]:
        """Return everything but the histograms as plain values."""
        hidden = {"periods", "skews"}
        names = [item.name for item in fields(self) if item.name not in hidden]
        return {name: getattr(self, name) for name in names}


def with_tares(
    found: Sequence[RigTrial], trials: Sequence[TaredTrial]
) -> list[RigTrial]:
    """Return the health of trials with what the tares of their sessions tell.

    Args:
        found: of each trial by itself.
        trials: the same trials, sessions in the order they are given.
    """
    known = uncertainties_of(trials)
    completed: list[RigTrial] = []
    for one, trial, change in zip(found, trials, tare_changes(trials), strict=True):
        uncertainty = uncertainty_of(trial, known)
        completed.append(
            replace(
                one,
                tare_bracket=None if change is None else float(np.linalg.norm(change)),
                force_uncertainty=None if uncertainty is None else uncertainty.mean,
                floor=_floor(one.noise, uncertainty),
            )
        )
    return completed


def health_of(trial: RecordedTrial) -> RigTrial:
    """Return the health of one trial, without what the tares of its session tell."""
    gaps = np.diff(trial.t) * 1e3
    age = _ages(trial)
    q7 = trial.cycles["position"][:, 6]
    tare = trial.payload.bias[:3]
    is_moving = np.abs(np.nan_to_num(trial.traction[:, 0])) > _MOVING
    is_saturated = (trial.cycles["flags"] & int(Flag.FT_SATURATED)) != 0
    provenance = trial.metadata["provenance"]
    return RigTrial(
        terrain=trial.terrain,
        name=trial.name,
        started_utc=trial.metadata["trial"].get("started_utc", ""),
        cycles=trial.t.size,
        missed=int(trial.metadata["result"]["cycles_missed"]),
        periods=np.histogram(gaps, PERIOD_EDGES)[0].astype(np.float64),
        period=float(np.median(gaps)),
        longest_gap=float(gaps.max()),
        skews=np.histogram(age, SKEW_EDGES)[0].astype(np.float64),
        skew=_three(np.quantile(age, (0.05, 0.5, 0.95)) if age.size else np.zeros(3)),
        tare=_three(tare),
        tare_bracket=None,
        joint7=float(np.abs(q7 - q7[0]).max() * 1e3),
        puck_degc=_row(provenance.get("pucks:temperature_degc", "")),
        motor_degc=_row(provenance.get("pucks:motor_temperature_degc", "")),
        largest_F_t=float(np.abs(trial.traction[:, 1]).max()),
        measurable_F_t=_measurable(provenance.get("ft_sensor:ranges", ""), trial),
        saturated=float(np.mean(is_saturated)),
        noise=_noise(trial),
        force_uncertainty=None,
        floor=None,
        load_bias=_load_bias(trial, is_moving),
        drag=_drag(trial, is_moving),
        lateral=float(np.abs(trial.lateral[is_moving]).mean())
        if is_moving.any()
        else None,
    )


def _ages(trial: RecordedTrial) -> Array:
    """Return the age of the force sample when the joints had answered [ms]."""
    arm, ft = (trial.cycles[key].astype(np.int64) for key in ("arm_ns", "ft_ns"))
    is_known = (arm > 0) & (ft > 0)
    return (arm - ft)[is_known].astype(np.float64) * 1e-6


def _floor(noise: float | None, uncertainty: ForceUncertainty | None) -> float | None:
    """Return the mean absolute error [N] that no model can be better than."""
    if noise is None:
        return None
    return (uncertainty or ForceUncertainty(0, 0.0)).floor(noise)


def _noise(trial: RecordedTrial) -> float | None:
    """Return the spread of smoothed F_t [N] before the foot moves."""
    at_rest = trial.t < _REST
    if np.count_nonzero(at_rest) < _SHORTEST:
        return None
    smooth = moving_average(trial.traction[at_rest, 1], _SMOOTHING)
    return float(smooth.std())


def _measurable(ranges: str, trial: RecordedTrial) -> float | None:
    """Return the largest traction that a sensor with these ranges can measure [N].

    Its origin is taken to be in the tool plate, a little farther from the sole than it
    is, so the figure is on the safe side.
    """
    numbers = _row(ranges)
    if len(numbers) != 6:
        return None
    fx, fy, fz, tx, ty, tz = numbers
    return largest_traction((fx, fy, fz, tx, ty, tz), float(trial.sole_point[2]))


def _load_bias(trial: RecordedTrial, is_moving: np.ndarray) -> float | None:
    """Return how far F_n lies above the virtual mass's weight across the slope [N].

    Friction of the joints, what the gravity model gets wrong, and the hand.
    """
    try:
        mass = float(trial.metadata["trial"]["effective_mass_kg"])
    except (KeyError, ValueError):
        return None
    if not is_moving.any() or not np.isfinite(mass):
        return None
    set_load = mass * GRAVITY * np.cos(trial.frame.incline)
    return float(np.median(trial.traction[is_moving, 2]) - set_load)


def _sliding_torques(trial: RecordedTrial) -> Array | None:
    """Return the friction of sliding motors [N m], shape (7,), as the trial met it.

    By the calibration in its file; None = it has none.
    """
    try:
        stored = friction_from_toml(trial.friction_text, trial.name)
        share = float(trial.metadata["trial"].get("friction_compensation", "0"))
    except (SettingsError, ValueError):
        return None
    if stored.is_simulated != trial.is_simulated or not 0.0 <= share <= 1.0:
        return None
    return stored.fit.sliding_left(share)


def _drag(trial: RecordedTrial, is_moving: np.ndarray) -> float | None:
    """Return the force along x_T [N] whose power the joints' Coulomb friction takes.

    F v_t = sum_j c_j |qd_j|: power in is power lost, whatever the joints do.
    """
    if not is_moving.any():
        return None
    speeds, coulomb = trial.cycles["velocity"][is_moving], trial.constants.coulomb
    torques = _sliding_torques(trial)
    if torques is not None:
        speeds, coulomb = speeds @ trial.constants.j2mp.T, torques
    lost = np.abs(speeds) @ coulomb
    return float(np.median(lost / np.abs(trial.traction[is_moving, 0])))


def _row(text: str) -> tuple[float, ...]:
    """Return the numbers in a metadata value; any other word is left out."""
    numbers: list[float] = []
    for part in text.split():
        with suppress(ValueError):
            numbers.append(float(part))
    return tuple(number for number in numbers if np.isfinite(number))


def _three(values: Array) -> tuple[float, float, float]:
    first, second, third = (float(value) for value in values)
    return first, second, third
