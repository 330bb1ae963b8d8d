"""From a log, a URDF and what a person states to trials: v_t, F_t and F_n over time.

F = force of the ground on the foot in the axes of the base; x_T the direction of the
slip, z_T the normal of the ground:

    F = R (s (f_raw - b) - m R^T g_w),   v_t = v . x_T,  F_t = -F . x_T,  F_n = F . z_T

Everything that changes a number is stated in an `ImportRequest`. What the log shows of
it is computed in `checks` and applied nowhere.
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
    Check,
    Judged,
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
_UPRIGHT = 0.1  # of a direction in the ground: nearly along its normal
_FEWEST_ROWS = 3


@dataclass(frozen=True, slots=True)
class ImportedTrial:
    """One trial of a log, at the rate of the joints.

    Attributes:
        name: e.g. T01.
        start: of it, in seconds of the log.
        t: time since its first row [s], shape (n,).
        q: positions of the joints [rad, m], shape (n, joints).
        raw: wrench as recorded, at the time of the joints [N, N m], shape (n, 6).
        foot: position in the base [m], shape (n, 3).
        velocity: of the foot in the base [m/s], shape (n, 3).
        force: of the ground on the foot in the base [N], shape (n, 3).
        traction: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
        series: the same as the models take it.
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
    """What came of a log.

    Attributes:
        request: what was stated.
        format: of the log, in words.
        urdf: the robot.
        joints: the channel of the joints.
        wrench: the channel of the wrench.
        joint_names: of the joints between the base and the foot.
        checks: what was stated beside what the log shows.
        trials: the trials.
        warnings: what a person should know.
        losses: what could not be read of the log.
        is_simulated: the log says that its devices were simulated.
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
    """Read a log and return its trials.

    Raises:
        SettingsError: log or URDF cannot be used, or what is stated cannot be.
    """
    if abs(request.lag) > LARGEST_LAG:
        raise SettingsError(
            f"--lag {request.lag * 1e3:g} ms is beyond {LARGEST_LAG * 1e3:g} ms.",
            hint="--clock receipt takes the recorder's times.",
        )
    urdf = read_urdf(request.urdf)
    leg = RobotLeg(urdf, request.foot, request.sensor)
    axes = _axes(request.along, request.normal)
    with open_log(request.log) as log:
        record = record_of_leg(log, leg, request.joints, request.wrench, request.clock)
        warnings = _clock_warnings(record, request)
        require_no_jump(record.joints)
        warnings += [
            *_rate_warnings(record, request),
            *_channel_warnings(record, request, log),
        ]
        raw = record.raw(request.lag)
        raw[_stuck_rows(record, request)] = np.nan
        payload = _payload(request, record, raw)
        sensor = record.path.sensor
        force = payload.to_base(payload.contact(raw, sensor), sensor)
        values = traction(axes, record.path.velocity, force)
        spans = _trial_rows(request, record.t)
        judged = Judged(record, spans, axes, payload, raw, force, values)
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
            leg.joints,
            checks,
            trials,
            warnings,
            list(log.losses),
            log.is_simulated,
        )


def _axes(along: Array, normal: Array) -> Array:
    """Rows x_T, y_T, z_T in the base, shape (3, 3); raises SettingsError."""
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
    """What receipts say of the stamps; raises SettingsError where it is not decided."""
    clocks = {each.topic.name: each.clock for each in (record.joints, record.wrench)}
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
    found: list[str] = []
    for channel in (record.joints, record.wrench):
        step = float(np.median(np.diff(channel.clock.times_ns))) * 1e-9
        name, rate = channel.topic.name, 1.0 / step
        if rate < SLOWEST_RATE and not request.is_slow:
            raise SettingsError(
                f"{request.log}: {name} has {rate:.1f} Hz, slips need "
                f"{USUAL_RATE:.0f} Hz.",
                hint="--slow takes it, for means only.",
            )
        if rate < USUAL_RATE * 0.99:
            found.append(f"{name} has {rate:.1f} Hz: slips are not seen, means are")
    return found


def _channel_warnings(
    record: LegRecord, request: ImportRequest, log: LogFile
) -> list[str]:
    """What the channels lack."""
    found = [
        f"{each.topic.name}: {each.clock.text}"
        for each in (record.joints, record.wrench)
        if each.clock.left_out or each.clock.repeated
    ]
    found += record.joints.warnings
    if record.motion.dropped:
        found.append(f"{record.motion.dropped} rows lie in gaps of the joints")
    frame = record.wrench.frame_id
    if frame and frame != request.sensor:
        found.append(
            f"the wrench names the frame {frame[:60]!r}; {request.sensor!r} is used"
        )
    if request.is_estimated:
        found.append("the wrench is estimated by the robot, not measured at the foot")
    for first, last in record.wrench.stuck:
        begin = (first - int(record.joints.clock.times_ns[0])) * 1e-9
        found.append(
            f"{record.wrench.topic.name}: one and the same reading for "
            f"{(last - first) * 1e-9:.2f} s from {begin:.2f} s on; its rows in a trial "
            "are left out"
        )
    return [*found, *log.losses]


def _stuck_rows(record: LegRecord, request: ImportRequest) -> Bools:
    """Whether a row lies in a trial, and its reading is one that never changes."""
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


def _payload(request: ImportRequest, record: LegRecord, raw: Array) -> Payload:
    """Tare and weight as stated; raises SettingsError."""
    tare, weightless = (
        request.tare,
        Payload(request.mass, np.zeros(3), np.eye(3), request.sign, np.zeros(6)),
    )
    if isinstance(tare, str):
        bias = np.zeros(6)
    elif isinstance(tare, np.ndarray):
        bias = tare
    else:
        rows = rows_within(record.t, raw, tare)
        if np.count_nonzero(rows) < _FEWEST_ROWS:
            raise SettingsError(
                f"--tare {tare[0]:g}:{tare[1]:g} holds {np.count_nonzero(rows)} "
                "readings.",
                hint=f"The log goes from 0 to {record.t[-1]:.1f} s.",
            )
        # of a foot that touches nothing: what is left is the bias
        rest = weightless.contact(raw[rows], record.path.sensor[rows])
        bias = request.sign * rest.mean(axis=0)
    return Payload(request.mass, np.zeros(3), np.eye(3), request.sign, bias)


def _trial_rows(request: ImportRequest, t: Array) -> list[tuple[int, int]]:
    """(first, end) of every trial; raises SettingsError."""
    spans: list[tuple[int, int]] = []
    for begin, end in request.trials:
        rows = int(np.searchsorted(t, begin)), int(np.searchsorted(t, end, "right"))
        if rows[1] - rows[0] < _FEWEST_ROWS:
            raise SettingsError(
                f"--trials {begin:g}:{end:g} holds {rows[1] - rows[0]} rows.",
                hint=f"The log goes from 0 to {t[-1]:.1f} s.",
            )
        spans.append(rows)
    return spans


def _trial(
    name: str,
    span: tuple[int, int],
    judged: Judged,
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
