"""Health and measurement limits of the rig in one recorded trial."""

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
_SMOOTHING = 11  # samples, as in the preparation of trials
_REST = 0.3  # s at the start of a trial, at rest by the procedure
_SHORTEST = 50  # smallest number of samples for the noise


@dataclass(frozen=True, slots=True)
class RigTrial:
    """Health of the rig in one trial.

    Attributes:
        terrain: name of the terrain.
        name: session and trial.
        started_utc: start time, ISO 8601; empty if not recorded.
        cycles: number of recorded cycles.
        missed: cycles that the loop could not begin in time.
        periods: histogram of the cycle period over `PERIOD_EDGES`, shape (bins,); the
            last bin is open.
        period: median time from cycle to cycle [ms].
        longest_gap: longest time between cycles [ms].
        skews: histogram of the age of the force sample over `SKEW_EDGES`, (bins,).
        skew: 5 %, 50 % and 95 % quantiles of that age (joint minus force time) [ms].
        tare: force subtracted as sensor offset [N], x y z of the sensor.
        tare_bracket: change from this trial's tare to the next [N]; None if none
            followed.
        joint7: largest motion of the locked joint [mrad].
        puck_degc: last reported temperatures of the pucks [degrees Celsius].
        motor_degc: last reported temperatures of the motors [degrees Celsius].
        largest_F_t: largest traction measured [N].
        measurable_F_t: largest traction that the sensor can measure at the sole by
            its ranges [N]; None if the ranges are unknown.
        saturated: share of cycles whose force sample was out of range [-].
        noise: standard deviation of smoothed F_t at rest [N]; None without rest.
        force_uncertainty: standard uncertainty of mean F_t and F_n from the tares of
            the session [N]; None with fewer than two.
        floor: mean absolute error of smoothed F_t from noise and tares [N], from noise
            alone if the tares are not known; None without rest.
        load_bias: median F_n of the moving foot minus the set load [N].
        drag: force along x_T needed to overcome the joints' Coulomb friction [N], by
            the recorded calibration minus the compensation, otherwise by the arm model;
            median over the moving samples.
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
        """Name of the session."""
        return self.name.partition("/")[0]

    def numbers(self) -> dict[str, Any]:
        """Return everything except the histograms as plain values."""
        hidden = {"periods", "skews"}
        names = [item.name for item in fields(self) if item.name not in hidden]
        return {name: getattr(self, name) for name in names}


def with_tares(
    found: Sequence[RigTrial], trials: Sequence[TaredTrial]
) -> list[RigTrial]:
    """Add the results from the tares of the sessions to the health of trials.

    Args:
        found: health of each trial without tares.
        trials: the same trials, sessions in the order they are given.
    """
    uncertainties = uncertainties_of(trials)
    completed: list[RigTrial] = []
    for health, trial, change in zip(found, trials, tare_changes(trials), strict=True):
        uncertainty = uncertainty_of(trial, uncertainties)
        completed.append(
            replace(
                health,
                tare_bracket=None if change is None else float(np.linalg.norm(change)),
                force_uncertainty=None if uncertainty is None else uncertainty.mean,
                floor=_floor(health.noise, uncertainty),
            )
        )
    return completed


def health_of(trial: RecordedTrial) -> RigTrial:
    """Compute the health of one trial, without the tares of its session."""
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
    """Return the age of the force sample at the time of the joint replies [ms]."""
    arm, ft = (trial.cycles[key].astype(np.int64) for key in ("arm_ns", "ft_ns"))
    is_known = (arm > 0) & (ft > 0)
    return (arm - ft)[is_known].astype(np.float64) * 1e-6


def _floor(noise: float | None, uncertainty: ForceUncertainty | None) -> float | None:
    """Return the lower limit of the mean absolute error of any model [N]."""
    if noise is None:
        return None
    return (uncertainty or ForceUncertainty(0, 0.0)).floor(noise)


def _noise(trial: RecordedTrial) -> float | None:
    """Return the standard deviation of smoothed F_t [N] before the foot moves."""
    at_rest = trial.t < _REST
    if np.count_nonzero(at_rest) < _SHORTEST:
        return None
    smooth = moving_average(trial.traction[at_rest, 1], _SMOOTHING)
    return float(smooth.std())


def _measurable(ranges: str, trial: RecordedTrial) -> float | None:
    """Return the largest traction that a sensor with these ranges can measure [N].

    The sensor's origin is assumed in the tool plate, slightly further from the sole
    than it is, so the result is conservative.
    """
    numbers = _row(ranges)
    if len(numbers) != 6:
        return None
    fx, fy, fz, tx, ty, tz = numbers
    return largest_traction((fx, fy, fz, tx, ty, tz), float(trial.sole_point[2]))


def _load_bias(trial: RecordedTrial, is_moving: np.ndarray) -> float | None:
    """Return the excess of F_n over the normal component of the virtual weight [N].

    Causes: joint friction, errors of the gravity model, and the hand.
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
    """Return the uncompensated sliding friction of the motors [N m], shape (7,).

    From the calibration in the trial's file; None without one.
    """
    try:
        stored = friction_from_toml(trial.friction_text, trial.name)
        share = float(trial.metadata["trial"].get("friction_compensation", "0"))
    except (SettingsError, ValueError):
        return None
    if stored.is_simulated != trial.is_simulated or not 0.0 <= share <= 1.0:
        return None
    return stored.fit.residual_friction(share)


def _drag(trial: RecordedTrial, is_moving: np.ndarray) -> float | None:
    """Return the force along x_T [N] that balances the joints' Coulomb friction.

    Power balance: F v_t = sum_j c_j |qd_j|.
    """
    if not is_moving.any():
        return None
    speeds, coulomb = trial.cycles["velocity"][is_moving], trial.constants.coulomb
    torques = _sliding_torques(trial)
    if torques is not None:
        speeds, coulomb = speeds @ trial.constants.j2mp.T, torques
    dissipated = np.abs(speeds) @ coulomb
    return float(np.median(dissipated / np.abs(trial.traction[is_moving, 0])))


def _row(text: str) -> tuple[float, ...]:
    """Parse the numbers in a metadata value; other words are skipped."""
    numbers: list[float] = []
    for part in text.split():
        with suppress(ValueError):
            numbers.append(float(part))
    return tuple(number for number in numbers if np.isfinite(number))


def _three(values: Array) -> tuple[float, float, float]:
    first, second, third = (float(value) for value in values)
    return first, second, third
