"""Comparison of the user's input with the log; a check never changes a number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.frozen_channels import frozen_channels
from analysis.data.plausibility import (
    SHORTEST,
    SLOWEST,
    UNEVEN,
    doubts_of,
    moment_doubts,
)
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import Array, TractionSeries
from analysis.logs.clocks import lag_by_receipts
from analysis.logs.estimates import (
    LONGEST_LAG,
    SHORTEST_PATH,
    STEADY,
    SURE,
    Bools,
    Estimate,
    find_direction,
    find_lag,
    find_mass,
    find_normal,
    find_quiet,
    find_sole,
    turn_deg,
)
from analysis.logs.leg_record import LegRecord, rows_within
from analysis.logs.request import ImportRequest
from analysis.logs.signs import (
    PRESSED_FORCE,
    moment_warnings,
    path_warnings,
    side_warnings,
    sign_figures,
)
from ft_sensor.payload import Payload
from wam.model.constants import GRAVITY

LARGEST_MASS_ERROR = 0.02  # kg
LARGEST_TILT = 1.0  # degrees of the normal; at 2 degrees F_t/F_n is wrong by 0.035
LARGEST_ABOVE = 0.010  # m between the origin of the foot and where the moments act
_UP = np.array([0.0, 0.0, 1.0])
_ON_GROUND = 0.001  # m above its lowest position below which a foot is not free
_LEAST_TURN = 2.0  # degrees of turn under load above which a mass of 0 is reported
_MASS_STEP = 0.1  # kg, unit of mass in that warning
_REMEDIES = {
    "lag": "check --lag",
    "unit": "the URDF is in m, positions in rad or m, forces in N: correct what is not",
}
_OPTIONS = "check --sensor, --acts, --tare, --along, --normal and the URDF"


@dataclass(frozen=True, slots=True)
class Check:
    """Comparison of one stated quantity with the log.

    Attributes:
        name: name of the quantity.
        stated: stated values in `unit`; empty if nothing was stated.
        unit: unit of the values; "" if dimensionless.
        shown: values from the log; empty if it does not show them.
        spread: uncertainty of these values; `how` names its unit.
        how: method, or reason why there are no values.
        warning: warning if the two disagree; otherwise "".
    """

    name: str
    stated: tuple[float, ...]
    unit: str
    shown: tuple[float, ...]
    spread: tuple[float, ...]
    how: str
    warning: str = ""

    @property
    def text(self) -> str:
        """The check in one line."""
        stated = f"{_numbers(self.stated)} {self.unit} stated; " if self.stated else ""
        if not self.shown:
            return f"{self.name}: {stated}not shown: {self.how}"
        spread = f": {_numbers(self.spread)}" if self.spread else ""
        shown = f"{_numbers(self.shown)} {self.unit}".rstrip()
        return f"{self.name}: {stated}{shown} shown ({self.how}{spread})"


def _numbers(values: Sequence[float]) -> str:
    return ", ".join("not known" if math.isnan(x) else f"{x:z.4g}" for x in values)


@dataclass(frozen=True, slots=True)
class AppliedImport:
    """An import with all user input applied, ready for the checks.

    Attributes:
        record: joints, wrench and foot path.
        spans: (first, end) rows of every trial.
        axes: rows x_T, y_T, z_T in the base, shape (3, 3).
        payload: tare and mass.
        raw: raw readings at the times of the joints [N, N m], shape (n, 6).
        force: force of the ground on the foot in the base frame [N], shape (n, 3).
        values: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
    """

    record: LegRecord
    spans: Sequence[tuple[int, int]]
    axes: Array
    payload: Payload
    raw: Array
    force: Array
    values: Array

    @property
    def in_trials(self) -> Bools:
        """Whether each row lies in a trial, shape (n,)."""
        rows = np.zeros(len(self.values), bool)
        for first, end in self.spans:
            rows[first:end] = True
        return rows

    @property
    def largest_free_force(self) -> float:
        """Largest force of the free foot [N]: the error of F_t/F_n is that of the tilt.

        At least as much as the force of a quiet foot may change.
        """
        load = np.linalg.norm(self.force[self.in_trials], axis=1)
        load = load[load > PRESSED_FORCE]  # False for NaN
        usual = float(np.median(load)) if load.size else 0.0
        return max(STEADY, usual * math.tan(math.radians(LARGEST_TILT)))

    @property
    def height(self) -> Array:
        """Position of the foot along the normal [m], shape (n,)."""
        return self.record.path.foot @ self.axes[2]


def checks_of(judged: AppliedImport, request: ImportRequest) -> list[Check]:
    """Check everything that was stated, in the order of the options."""
    quiet = find_quiet(judged.record.t, judged.raw, judged.height)
    return [
        tare_check(judged, quiet),
        mass_check(judged, request, quiet),
        lag_check(judged, request),
        clock_check(judged.record),
        normal_check(judged),
        direction_check(judged),
        sole_check(judged),
    ]


def sign_checks(judged: AppliedImport, doubts: Sequence[str]) -> list[Check]:
    """Check the signs of the forces in the trials.

    Args:
        judged: the import.
        doubts: warnings of other checks, which help to find the cause.

    Raises:
        SettingsError: the forces cannot come from the ground.
    """
    rows = judged.in_trials
    lateral = judged.force @ judged.axes[1]
    try:
        figures = sign_figures(judged.values[rows], lateral[rows])
    except SettingsError as error:
        context = "".join(f"{doubt}. " for doubt in doubts)
        raise SettingsError(error.message, hint=f"{context}{error.hint}") from error
    return [
        Check(figure.name, (), "", (figure.value,), (), f"limit {figure.limit}")
        for figure in figures
    ]


def tare_check(judged: AppliedImport, quiet: Bools) -> Check:
    """Check the tare by the force of the quiet free foot."""
    stated = tuple(judged.payload.bias[:3].tolist())
    if not quiet.any():
        how = "the foot is never quiet 10 mm above its lowest position"
        return Check("tare", stated, "N", (), (), how, f"--tare is not checked: {how}")
    rest = judged.force[quiet]
    mean = float(np.linalg.norm(rest.mean(axis=0)))
    spread = (float(np.mean(rest.std(axis=0))),)
    how = f"force of the free foot in {np.count_nonzero(quiet)} quiet rows; noise"
    limit = judged.largest_free_force
    warning = (
        f"the free foot reads {mean:.2f} N (limit {limit:.2f}): a forgotten tare or "
        "weight? Check --tare and --tool-mass"
        if mean > limit
        else ""
    )
    return Check("tare", stated, "N", (mean,), spread, how, warning)


def mass_check(judged: AppliedImport, request: ImportRequest, quiet: Bools) -> Check:
    """Check the mass by readings of the free foot in several orientations."""
    sensor = judged.record.path.sensor
    estimate = find_mass(judged.raw[quiet, :3], sensor[quiet], request.sign)
    warning = ""
    if estimate.value:
        (mass,), (error,) = estimate.value, estimate.spread
        if abs(mass - request.mass) > max(LARGEST_MASS_ERROR, 3.0 * error):
            warning = (
                f"--tool-mass {request.mass:g} kg, the free foot shows {mass:.2f} kg"
            )
    return _check("mass", (request.mass,), "kg", estimate, warning)


def lag_check(judged: AppliedImport, request: ImportRequest) -> Check:
    """Check the lag by starts and stops of the foot."""
    motion = judged.record.motion
    further = find_lag(motion.t, motion.step, judged.values)  # beyond the stated lag
    estimate = Estimate(
        tuple((request.lag + x) * 1e3 for x in further.value),
        tuple((request.lag + x) * 1e3 for x in further.spread),
        further.how,
    )
    warning, stated = "", request.lag * 1e3
    if estimate.value:
        low, high = estimate.spread
        if not low - SURE * 1e3 <= stated <= high + SURE * 1e3:
            warning = (
                f"--lag {stated:.0f} ms; starts and stops show {low:.0f} to "
                f"{high:.0f} ms"
            )
    else:
        warning = _unseen_lag(judged.record, stated)
    return _check("lag", (stated,), "ms", estimate, warning)


def _unseen_lag(record: LegRecord, stated: float) -> str:
    """Warn of a lag [ms] that neither the motion nor the clocks show."""
    fits = [channel.clock.fit for channel in (record.joints, record.wrench)]
    apart = lag_by_receipts(fits[0], fits[1])
    shown = 0.0 if apart is None else apart * 1e3
    if abs(stated - shown) <= LONGEST_LAG * 1e3:
        return ""
    clocks = "show no offset" if apart is None else f"are {shown:.0f} ms apart"
    return (
        f"--lag {stated:.0f} ms: the clocks {clocks}, and the motion "
        f"shows no further lag of up to {LONGEST_LAG * 1e3:.0f} ms"
    )


def clock_check(record: LegRecord) -> Check:
    """Estimate the offset between the clocks of both topics, delays included."""
    fits = [channel.clock.fit for channel in (record.joints, record.wrench)]
    shown = lag_by_receipts(fits[0], fits[1])
    how = "; ".join(
        f"{channel.topic.name}: {'no stamps' if fit is None else fit.text}"
        for channel, fit in zip((record.joints, record.wrench), fits, strict=True)
    )
    value = () if shown is None else (shown * 1e3,)
    return Check("clocks apart", (), "ms", value, (), how)


def normal_check(judged: AppliedImport) -> Check:
    """Check the normal by the path of the pressed foot, together and in each trial."""
    pressed = judged.in_trials & (judged.values[:, 2] > PRESSED_FORCE)
    foot, x_T = judged.record.path.foot, judged.axes[0]
    estimate = find_normal(foot[pressed], SHORTEST)
    warning = _tilt_warning(estimate, foot[pressed] @ x_T, x_T)
    if not warning:
        texts: list[str] = []
        for number, (first, end) in enumerate(judged.spans, 1):
            path = foot[first:end][pressed[first:end]]
            text = _tilt_warning(find_normal(path, SHORTEST), path @ x_T, x_T)
            texts += [f"T{number:02d}: {text}"] if text else []
        warning = "; ".join(texts)
    return _check("normal", tuple(judged.axes[2].tolist()), "", estimate, warning)


def _tilt_warning(normal: Estimate, ahead: Array, x_T: Array) -> str:
    """Compare along the path only: a straight one shows no tilt to its side.

    On a short path stones may deflect the foot by `UNEVEN`.

    Args:
        normal: estimate from the path of the pressed foot.
        ahead: positions of the path along `x_T` [m], shape (n,).
        x_T: stated direction of the slip, shape (3,).
    """
    if not normal.value:
        return ""
    along = min(1.0, abs(float(np.array(normal.value) @ x_T)))
    tilt, length = math.degrees(math.asin(along)), float(np.ptp(ahead))
    if tilt <= LARGEST_TILT + normal.spread[0]:
        return ""
    if length < SHORTEST_PATH and length * along <= UNEVEN:
        return ""
    return (
        f"--normal is {tilt:.1f} degrees off the foot's path (limit "
        f"{LARGEST_TILT:g} and {normal.spread[0]:.1f} of the path)"
    )


def direction_check(judged: AppliedImport) -> Check:
    """Check the direction by the path of the foot in the trials."""
    foot = judged.record.path.foot
    estimate = find_direction(foot, judged.spans, judged.axes[2])
    return _check("direction", tuple(judged.axes[0].tolist()), "", estimate)


def sole_check(judged: AppliedImport) -> Check:
    """Check that the origin of the foot lies where the moments act."""
    sensor, lever = judged.record.path.sensor, judged.record.path.lever
    wrench = judged.payload.contact(judged.raw, sensor)
    pressed = judged.in_trials & (judged.values[:, 2] > PRESSED_FORCE)
    force, moment = wrench[pressed, :3], wrench[pressed, 3:]
    moment = moment - np.cross(lever[pressed], force)
    normal = np.mean(judged.axes[2] @ sensor[pressed], axis=0) if len(force) else _UP
    estimate = find_sole(force, moment, normal)
    turned, warning = turn_deg(sensor[pressed]) if len(force) else 0.0, ""
    if estimate.value and turned > _LEAST_TURN:
        (above,), (spread,) = estimate.value, estimate.spread
        if abs(above) > LARGEST_ABOVE * 1e3 + spread:
            side = "below" if above < 0.0 else "above"
            warning = (
                f"the moments act {abs(above):.0f} mm {side} the origin of --foot "
                f"(limit {LARGEST_ABOVE * 1e3:g} and {spread:.0f} of the estimate), "
                f"and it turns by {turned:.0f} degrees in the trials: v_t is wrong by "
                "this distance times the rate of the turn, unless the sole is wide and "
                "its centre of pressure moves with the friction"
            )
    return _check("sole", (0.0,), "mm", estimate, warning)


def _check(
    name: str,
    stated: tuple[float, ...],
    unit: str,
    estimate: Estimate,
    warning: str = "",
) -> Check:
    value, spread = estimate.value, estimate.spread
    return Check(name, stated, unit, value, spread, estimate.how, warning)


def warnings_of(judged: AppliedImport) -> list[str]:
    """Collect warnings on forces, moments and paths of the trials."""
    rows = judged.in_trials
    values, lateral = judged.values[rows], (judged.force @ judged.axes[1])[rows]
    foot = judged.record.path.foot
    return [
        *_weight_warnings(judged),
        *side_warnings(values, lateral),
        *_moment_warnings(judged),
        *_channel_warnings(judged),
        *(
            text
            for number, (first, end) in enumerate(judged.spans, 1)
            for text in path_warnings(f"T{number:02d}", foot[first:end], judged.axes)
        ),
    ]


def tare_warnings(judged: AppliedImport, request: ImportRequest) -> list[str]:
    """Collect warnings on the window of a tare."""
    if not isinstance(request.tare, tuple):
        return []
    rows = rows_within(judged.record.t, judged.raw, request.tare)
    warnings: list[str] = []
    above = float(judged.height[rows].min() - np.nanmin(judged.height))
    if above < _ON_GROUND:
        warnings.append(
            "within the window of --tare the foot is at its lowest position of the "
            "log: if it stands on the ground, the tare removes its load"
        )
    raw = judged.raw[rows, :3]
    half = len(raw) // 2
    drift = float(np.linalg.norm(raw[:half].mean(axis=0) - raw[half:].mean(axis=0)))
    limit = judged.largest_free_force
    if half and drift > limit:
        warnings.append(
            f"the halves of the window of --tare differ by {drift:.2f} N (limit "
            f"{limit:.2f})"
        )
    return warnings


def _weight_warnings(judged: AppliedImport) -> list[str]:
    """Warn of a mass of 0 if the sensor turns under load."""
    turned = turn_deg(judged.record.path.sensor[judged.in_trials])
    if judged.payload.mass or turned <= _LEAST_TURN:
        return []
    swing = 2.0 * math.sin(math.radians(min(turned, 180.0)) / 2.0)
    largest = swing * GRAVITY * _MASS_STEP
    return [
        f"--tool-mass 0, and the sensor turns by {turned:.0f} degrees in the trials: "
        f"every {_MASS_STEP:g} kg of mass that is not stated is {largest:.2f} N"
    ]


def _moment_warnings(judged: AppliedImport) -> list[str]:
    """Compare the moments with the lever of the foot, in the sensor's axes."""
    path = judged.record.path
    wrench = judged.payload.contact(judged.raw, path.sensor)
    force, moment = wrench[:, :3], wrench[:, 3:]
    sliding = judged.in_trials & (judged.values[:, 0] > SLOWEST)
    sliding &= judged.values[:, 2] > PRESSED_FORCE
    if not sliding.any():
        return []
    doubts = moment_doubts(force[sliding], moment[sliding])
    warnings = [replace(doubt, remedy=_OPTIONS).text for doubt in doubts]
    return [*warnings, *moment_warnings(moment, path.lever, force)]


def _channel_warnings(judged: AppliedImport) -> list[str]:
    """Check each channel of the sensor while the foot slides."""
    t, record, warnings = judged.record.t, judged.record, list[str]()
    for first, end in judged.spans:
        is_in = (record.wrench_t >= t[first]) & (record.wrench_t < t[end - 1])
        channels = frozen_channels(record.wrench_t[is_in], record.wrench.wrench[is_in])
        warnings += [f"{channel.text} while the foot slides" for channel in channels]
    return warnings


def series_warnings(series: TractionSeries) -> list[str]:
    """Check velocity and forces of a trial for plausibility."""
    warnings: list[str] = []
    for doubt in doubts_of(prepare_trial(series, PrepareOptions())):
        remedy = _REMEDIES.get(doubt.name, _OPTIONS)
        warnings.append(f"{series.name}: {replace(doubt, remedy=remedy).text}")
    return warnings
