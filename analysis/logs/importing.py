"""Computation of v_t, F_t and F_n from a log, a URDF and the user's input.

F is the force of the ground on the foot in the base frame, x_T the direction of the
slip, z_T the normal of the ground:

    F = R (s (f_raw - b) - m R^T g_w),   v_t = v . x_T,  F_t = -F . x_T,  F_n = F . z_T

Everything that affects a number is stated in an `ImportRequest`. Estimates from the log
are computed in `checks` and never applied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array, TractionSeries
from analysis.logs.channels import (
    JointChannel,
    WrenchChannel,
    require_no_jump,
)
from analysis.logs.checks import (
    AppliedImport,
    Check,
    checks_of,
    series_warnings,
    sign_checks,
    tare_warnings,
    warnings_of,
)
from analysis.logs.clocks import (
    doubts_of_clock,
    doubts_of_lag,
    lag_by_receipts,
    require_no_doubt,
)
from analysis.logs.estimates import Bools
from analysis.logs.leg_record import LegRecord, record_of_leg, rows_within
from analysis.logs.log_file import LogFile
from analysis.logs.motion import (
    seconds_since,
)
from analysis.logs.opening import open_log
from analysis.logs.request import ImportRequest
from analysis.logs.robot import RobotLeg, Urdf, read_urdf
from ft_sensor.payload import Payload, traction

SLOWEST_RATE, USUAL_RATE = 50.0, 100.0  # Hz
LARGEST_LAG = 10.0  # s
_UPRIGHT = 0.1  # smallest share of a direction that lies in the ground plane
_FEWEST_ROWS = 3
_MOST_MISSING = 0.01  # largest share of rows without a reading that is not reported
_ROUNDED = 0.05  # s; the extent is printed with one decimal


@dataclass(frozen=True, slots=True)
class ImportedTrial:
    """One trial of a log, at the rate of the joints.

    Attributes:
        name: name, e.g. T01.
        start: start time [s of the log].
        t: time since its first row [s], shape (n,).
        q: positions of the joints [rad, m], shape (n, joints).
        raw: raw wrench at the times of the joints [N, N m], shape (n, 6).
        foot: position of the foot in the base frame [m], shape (n, 3).
        velocity: velocity of the foot in the base frame [m/s], shape (n, 3).
        force: force of the ground on the foot in the base frame [N], shape (n, 3).
        traction: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
        series: the trial as input of the models.
    """

    name: str
    start: float
    t: Array
    q: Array
    raw: Array
    foot: Array
    velocity: Array
    force: Array
    traction: Array
    series: TractionSeries


@dataclass(frozen=True, slots=True)
class ImportedLog:
    """Result of the import of a log.

    Attributes:
        request: the user's input.
        format: format of the log in words.
        urdf: the robot.
        joints: channel of the joints.
        wrench: channel of the wrench.
        joint_names: names of the joints between the base and the foot.
        checks: comparisons of the input with the log.
        trials: the trials.
        warnings: warnings for the user.
        losses: parts of the log that could not be read.
        is_simulated: the log states that its devices were simulated.
    """

    request: ImportRequest
    format: str
    urdf: Urdf
    joints: JointChannel
    wrench: WrenchChannel
    joint_names: Sequence[str]
    checks: Sequence[Check]
    trials: Sequence[ImportedTrial]
    warnings: Sequence[str]
    losses: Sequence[str]
    is_simulated: bool


def import_log(request: ImportRequest) -> ImportedLog:
    """Import the trials of a log.

    Raises:
        SettingsError: the log, the URDF or the input is unusable.
    """
    if abs(request.lag) > LARGEST_LAG:
        raise SettingsError(
            f"--lag {request.lag * 1e3:g} ms is beyond {LARGEST_LAG * 1e3:g} ms.",
            hint="--clock receipt takes the recorder's times.",
        )
    urdf = read_urdf(request.urdf)
    leg = RobotLeg(urdf, request.foot, request.sensor)
    _axes(request.along, request.normal)  # refused before the log is read
    with open_log(request.log) as log:
        record = record_of_leg(log, leg, request.joints, request.wrench, request.clock)
        return apply_request(request, urdf, leg.joints, log, record)


def apply_request(
    request: ImportRequest,
    urdf: Urdf,
    joint_names: Sequence[str],
    log: LogFile,
    record: LegRecord,
) -> ImportedLog:
    """Apply the user's input to the record of a log, and check it.

    Raises:
        SettingsError: the record or the input is unusable.
    """
    warnings = record_warnings(record, request, log)
    axes = _axes(request.along, request.normal)
    raw = record.raw(request.lag)
    is_missing: Bools = np.array(np.isnan(raw).any(axis=1))
    raw[_stuck_rows(record, request)] = np.nan
    extent = _extent(record.t, log.losses)
    payload = _payload(request, record, raw, extent)
    sensor = record.path.sensor
    force = payload.to_base(payload.contact(raw, sensor), sensor)
    values = traction(axes, record.path.velocity, force)
    spans = _trial_rows(request, record.t, extent)
    warnings += _missing_warnings(record.t, is_missing, spans)
    judged = AppliedImport(record, spans, axes, payload, raw, force, values)
    checks = checks_of(judged, request)
    doubts = [check.warning for check in checks if check.warning]
    doubts += tare_warnings(judged, request)
    checks = [*checks, *sign_checks(judged, doubts)]
    warnings += [*doubts, *warnings_of(judged)]
    trials = [
        _trial(f"T{k + 1:02d}", span, judged, request, log.is_simulated)
        for k, span in enumerate(spans)
    ]
    for trial in trials:
        warnings += series_warnings(trial.series)
    return ImportedLog(
        request,
        log.format,
        urdf,
        record.joints,
        record.wrench,
        joint_names,
        checks,
        trials,
        warnings,
        list(log.losses),
        log.is_simulated,
    )


def record_warnings(
    record: LegRecord, request: ImportRequest, log: LogFile
) -> list[str]:
    """Check clocks, joints and rates of a record; raises SettingsError."""
    warnings = _clock_warnings(record, request)
    require_no_jump(record.joints)
    return [
        *warnings,
        *_rate_warnings(record, request),
        *_channel_warnings(record, request, log),
    ]


def _axes(along: Array, normal: Array) -> Array:
    """Return the rows x_T, y_T, z_T in the base, shape (3, 3); raises SettingsError."""
    z_T = normal / np.linalg.norm(normal)
    flat = along - (along @ z_T) * z_T
    size = float(np.linalg.norm(flat))
    if size <= _UPRIGHT * float(np.linalg.norm(along)):
        raise SettingsError(
            "--along and --normal are the same direction.",
            hint="--along lies in the ground, --normal stands on it.",
        )
    x_T = flat / size
    return np.stack([x_T, np.cross(z_T, x_T), z_T])


def _clock_warnings(record: LegRecord, request: ImportRequest) -> list[str]:
    """Compare stamps and receipts; raises SettingsError if the user must decide."""
    channels = (record.joints, record.wrench)
    clocks = {channel.topic.name: channel.clock for channel in channels}
    fits = {name: clock.fit for name, clock in clocks.items()}
    if request.clock == "receipt":
        return [
            f"{name}: times of receipt, {'moved by' if fit else 'without'} its stamps"
            for name, fit in fits.items()
        ]
    doubts = [
        text
        for name, fit in fits.items()
        if fit is not None
        for text in doubts_of_clock(name, fit)
    ]
    shown = lag_by_receipts(*fits.values())
    if not doubts:
        doubts = doubts_of_lag(shown, request.lag)
    if request.clock is None:
        require_no_doubt(doubts, request.log, shown)
    return doubts


def _rate_warnings(record: LegRecord, request: ImportRequest) -> list[str]:
    warnings: list[str] = []
    for channel in (record.joints, record.wrench):
        step = float(np.median(np.diff(channel.clock.times_ns))) * 1e-9
        name, rate = channel.topic.name, 1.0 / step
        if rate < SLOWEST_RATE and not request.is_slow:
            raise SettingsError(
                f"{request.log}: {name} has {rate:.1f} Hz, the least is "
                f"{SLOWEST_RATE:.0f} Hz.",
                hint=f"Slips need {USUAL_RATE:.0f} Hz; --slow takes it for means.",
            )
        if rate < USUAL_RATE * 0.99:
            warnings.append(f"{name} has {rate:.1f} Hz: slips are not seen, means are")
    return warnings


def _channel_warnings(
    record: LegRecord, request: ImportRequest, log: LogFile
) -> list[str]:
    """Collect warnings on the channels."""
    warnings = [
        f"{channel.topic.name}: {channel.clock.text}"
        for channel in (record.joints, record.wrench)
        if channel.clock.left_out or channel.clock.repeated
    ]
    warnings += record.joints.warnings
    if record.motion.dropped:
        warnings.append(f"{record.motion.dropped} rows lie in gaps of the joints")
    frame = record.wrench.frame_id
    if frame and frame != request.sensor:
        warnings.append(
            f"the wrench names the frame {frame[:60]!r}; {request.sensor!r} is used"
        )
    if request.is_estimated:
        warnings.append(
            "the wrench is estimated by the robot, not measured at the foot"
        )
    for first, last in record.wrench.stuck:
        begin = (first - int(record.joints.clock.times_ns[0])) * 1e-9
        warnings.append(
            f"{record.wrench.topic.name}: unchanged reading for "
            f"{(last - first) * 1e-9:.2f} s from {begin:.2f} s on; its rows in a trial "
            "are dropped"
        )
    return [*warnings, *log.losses]


def _stuck_rows(record: LegRecord, request: ImportRequest) -> Bools:
    """Return the rows in trials whose reading is stuck."""
    is_stuck = np.zeros(len(record.t), bool)
    origin_ns = int(record.joints.clock.times_ns[0])
    at = record.t + request.lag
    for first, last in record.wrench.stuck:
        begin, end = (seconds_since(np.array([first, last]), origin_ns)).tolist()
        is_stuck |= (at > begin) & (at <= end)
    in_trial = np.zeros(len(record.t), bool)
    for begin, end in request.trials:
        in_trial |= (record.t >= begin) & (record.t <= end)
    return is_stuck & in_trial


def _extent(t: Array, losses: Sequence[str]) -> str:
    """The span of the log, and what could not be read of it."""
    return "; ".join([f"The log goes from 0 to {t[-1]:.1f} s", *losses]) + "."


def _require_within(
    option: str, span: tuple[float, float], t: Array, extent: str
) -> None:
    """Refuse a span of time [s of the log] that the joints do not cover."""
    if span[0] < -_ROUNDED or span[1] > t[-1] + _ROUNDED:
        raise SettingsError(
            f"{option} {span[0]:g}:{span[1]:g} is not within the log.", hint=extent
        )


def _payload(
    request: ImportRequest, record: LegRecord, raw: Array, extent: str
) -> Payload:
    """Make the payload from the stated tare and weight; raises SettingsError."""
    tare, weightless = (
        request.tare,
        Payload(request.mass, np.zeros(3), np.eye(3), request.sign, np.zeros(6)),
    )
    if isinstance(tare, str):
        bias = np.zeros(6)
    elif isinstance(tare, np.ndarray):
        bias = tare
    else:
        _require_within("--tare", tare, record.t, extent)
        rows = rows_within(record.t, raw, tare)
        if np.count_nonzero(rows) < _FEWEST_ROWS:
            raise SettingsError(
                f"--tare {tare[0]:g}:{tare[1]:g} holds {np.count_nonzero(rows)} "
                "readings.",
                hint=extent,
            )
        # the foot touches nothing, so the reading minus the weight is the bias
        residual = weightless.contact(raw[rows], record.path.sensor[rows])
        bias = request.sign * residual.mean(axis=0)
    return Payload(request.mass, np.zeros(3), np.eye(3), request.sign, bias)


def _trial_rows(request: ImportRequest, t: Array, extent: str) -> list[tuple[int, int]]:
    """Return (first, end) rows of every trial; raises SettingsError."""
    spans: list[tuple[int, int]] = []
    for begin, end in request.trials:
        _require_within("--trials", (begin, end), t, extent)
        rows = int(np.searchsorted(t, begin)), int(np.searchsorted(t, end, "right"))
        if rows[1] - rows[0] < _FEWEST_ROWS:
            raise SettingsError(
                f"--trials {begin:g}:{end:g} holds {rows[1] - rows[0]} rows.",
                hint=extent,
            )
        spans.append(rows)
    return spans


def _missing_warnings(
    t: Array, is_missing: Bools, spans: Sequence[tuple[int, int]]
) -> list[str]:
    """Warn of trials of which the wrench covers only a part."""
    warnings: list[str] = []
    for number, (first, end) in enumerate(spans, 1):
        rows = np.flatnonzero(is_missing[first:end])
        if len(rows) > _MOST_MISSING * (end - first):
            warnings.append(
                f"T{number:02d}: {len(rows)} of {end - first} rows have no reading of "
                f"the wrench and are dropped, the first at {t[first + rows[0]]:.2f} s"
            )
    return warnings


def _trial(
    name: str,
    span: tuple[int, int],
    judged: AppliedImport,
    request: ImportRequest,
    is_simulated: bool,
) -> ImportedTrial:
    rows = slice(*span)
    record, path = judged.record, judged.record.path
    t = record.t[rows]
    v_t, F_t, F_n = judged.values[rows].T
    rise = float(np.clip(judged.axes[0][2], -1.0, 1.0))
    series = TractionSeries(
        terrain=request.terrain,
        name=name,
        t=t - t[0],
        v_t=v_t,
        F_n=F_n,
        F_t=F_t,
        incline_deg=-float(np.degrees(np.arcsin(rise))),
        factors=request.factors,
        is_foreign=True,
        is_simulated=is_simulated,
    )
    return ImportedTrial(
        name,
        float(t[0]),
        t - t[0],
        record.motion.q[rows],
        judged.raw[rows],
        path.foot[rows],
        path.velocity[rows],
        judged.force[rows],
        judged.values[rows],
        series,
    )
