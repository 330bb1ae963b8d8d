"""From a log, a URDF and a few words to trials: v_t, F_t and F_n over time.

F = force of the ground on the foot in the axes of the base; x_T the direction of the
slip, z_T the normal of the ground:

    F = R (s (f_raw - b) - m R^T g_w),   v_t = v . x_T,  F_t = -F . x_T,  F_n = F . z_T
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.frozen_channels import FrozenChannel, frozen_channels
from analysis.data.plausibility import SLOWEST, doubts_of, free_moment
from analysis.data.prepare import PrepareOptions, moving_average, prepare_trial
from analysis.data.series import Array, TractionSeries
from analysis.data.terrain_kinds import Value
from analysis.logs.channels import (
    ChannelReader,
    JointChannel,
    WrenchChannel,
    choose_joints,
    choose_wrench,
    joint_states,
    read_wrench,
)
from analysis.logs.estimates import (
    LONGEST_LAG,
    SURE,
    Bools,
    Estimate,
    Lag,
    find_direction,
    find_ground,
    find_lag,
    find_unloaded,
    pressed_stretches,
    tare_of,
    turn_deg,
)
from analysis.logs.log_file import LogFile
from analysis.logs.motion import (
    JointMotion,
    joint_motion,
    mean_around,
    rows_averaged,
    seconds_since,
)
from analysis.logs.opening import open_log
from analysis.logs.robot import FramePath, RobotLeg, Urdf, read_urdf
from analysis.logs.signs import (
    Check,
    moment_warnings,
    side_warnings,
    sign_checks,
    way_warnings,
)
from analysis.logs.velocities import compare_velocities
from ft_sensor.payload import Payload, traction
from wam.model.constants import GRAVITY

Acts = Literal["ground-on-foot", "foot-on-ground"]
Tare = tuple[float, float] | Path | Array | Literal["none"] | None
PRESSED_FORCE = 2.0  # N; below it a foot is in the air
SLOWEST_RATE, USUAL_RATE = 50.0, 100.0  # Hz
_JOIN = 0.3  # s; a shorter lift parts no stroke
_LEAST_WAY = 0.02  # m forward that make a stroke a trial
_ON_GROUND = 0.001  # m above its lowest place at which a foot is not free
_FORGOTTEN = 1.0  # N that a tared sensor may read in the air
_TURN_TOLD = 2.0  # degrees of turn under load from which an unknown weight is named
_LITTLE = 0.1  # kg
_USUAL_LAG = 0.03  # s of a sensor's filter and its driver
_OWN = "traction_msgs/Cycle"
_CHECK_OPTIONS = "check --sensor, --acts, --tare, --along and the URDF"


@dataclass(frozen=True, slots=True)
class ImportRequest:
    """What is asked for.

    Attributes:
        log: file or folder.
        urdf: of the robot.
        foot: link of the URDF, the centre of the sole.
        sensor: link of the URDF in whose axes the wrench is.
        acts: what the numbers of the wrench are.
        wrench: TOPIC or TOPIC:FIELD; None = the only one.
        joints: topic; None = the only one.
        tare: (start, end) [s of the log], a log of the free foot, six numbers, "none"
            for a sensor that is tared, or None = found.
        mass: of everything below the gauges [kg]; None = found, if it can be.
        along: direction of the slip in the base; None = from the way.
        normal: of the ground in the base; None = from the way.
        incline_deg: of the ground along the slip, > 0 uphill [degrees]; None = from
            `normal`.
        heading_deg: of the slip about z, from x [degrees]; None = from `along`.
        lag: how late the wrench is stamped [s]; None = found.
        clock: "stamp" or "receipt"; None = stamps where they can be used.
        trials: (start, end) [s of the log]; None = every stroke.
        terrain: name of the terrain.
        factors: what else is known of terrain and foot, by name.
        is_slow: rates below 50 Hz are taken.
        is_estimated: the wrench is not measured but estimated by the robot.
    """

    log: Path
    urdf: Path
    foot: str
    sensor: str
    acts: Acts
    wrench: str | None = None
    joints: str | None = None
    tare: Tare = None
    mass: float | None = None
    along: Array | None = None
    normal: Array | None = None
    incline_deg: float | None = None
    heading_deg: float | None = None
    lag: float | None = None
    clock: str | None = None
    trials: Sequence[tuple[float, float]] | None = None
    terrain: str = "table"
    factors: Mapping[str, Value] = field(default_factory=dict[str, Value])
    is_slow: bool = False
    is_estimated: bool = False


@dataclass(frozen=True, slots=True)
class ImportedTrial:
    """One stroke of a log, at the rate of the joints.

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
        request: what was asked for.
        format: of the log, in words.
        urdf: the robot.
        joints: the channel of the joints.
        wrench: the channel of the wrench.
        joint_names: of the joints between the base and the foot.
        estimates: what was given or found.
        checks: of the signs.
        trials: the strokes.
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
    estimates: Sequence[Estimate]
    checks: Sequence[Check]
    trials: Sequence[ImportedTrial]
    warnings: Sequence[str]
    losses: Sequence[str]
    is_simulated: bool


def import_log(request: ImportRequest) -> ImportedLog:
    """Read a log and return its trials.

    Raises:
        SettingsError: log or URDF cannot be used, something is missing, or what is
            said of the wrench cannot be.
    """
    urdf = read_urdf(request.urdf)
    leg = RobotLeg(urdf, request.foot, request.sensor)
    with open_log(request.log) as log:
        if any(each.type_name == _OWN for each in log.topics.values()):
            raise SettingsError(
                f"{log.path}: this is a trial of Traction: report, fit and export read "
                "it.",
                hint="Write: traction export SESSION --to DIR, then traction fit DIR.",
            )
        topic = choose_wrench(log, request.wrench)
        if request.joints is None and not joint_states(log):
            raise _no_motion(log, request)
        reader = ChannelReader(choose_joints(log, request.joints), leg.joints, topic)
        joints, wrench = reader.read(log, request.clock)
        return _Import(request, urdf, leg, joints, wrench).result(log)


def _no_motion(log: LogFile, request: ImportRequest) -> SettingsError:
    """Return the refusal of a log without joints, with what its wrench says."""
    wrench = read_wrench(log, choose_wrench(log, request.wrench), request.clock)
    tare = np.zeros(6)
    about = "not tared"
    if isinstance(request.tare, Path):
        tare = _readings_of(request.tare, wrench, request.clock).mean(axis=0)
        about = "tare {:.3f}, {:.3f}, {:.3f} N".format(*tare[:3])
    force = (wrench.wrench - tare)[:, :3]
    row, axis = np.unravel_index(np.abs(force).argmax(), force.shape)
    times = seconds_since(wrench.clock.times_ns, int(wrench.clock.times_ns[0]))
    return SettingsError(
        f"{log.path}: no joints (sensor_msgs/JointState), so no motion of the foot and "
        f"no v_t. Its wrench: {wrench.clock.read} messages, "
        f"{wrench.clock.rate_by_stamp:.1f} Hz by stamps "
        f"({wrench.clock.rate_by_receipt:.0f} Hz by receipt), {about}, largest force "
        f"{force[row, axis]:.1f} N along {'xyz'[axis]}, {times[row]:.2f} s after the "
        "first.",
        hint="Record the joints into the same log.",
    )


def _readings_of(path: Path, like: WrenchChannel, clock: str | None) -> Array:
    """Return the readings of a log of the free foot, shape (n, 6)."""
    with open_log(path) as log:
        name = like.topic.name
        named = f"{name}:{like.field}" if name in log.topics and like.field else None
        return read_wrench(log, choose_wrench(log, named), clock).wrench


class _Import:
    """The steps of one import; each adds to estimates and warnings."""

    def __init__(
        self,
        request: ImportRequest,
        urdf: Urdf,
        leg: RobotLeg,
        joints: JointChannel,
        wrench: WrenchChannel,
    ) -> None:
        self._request, self._urdf, self._leg = request, urdf, leg
        self._joints, self._wrench = joints, wrench
        self._warnings: list[str] = []
        self._sign = 1.0 if request.acts == "ground-on-foot" else -1.0
        self._check_rates()
        self._motion: JointMotion = joint_motion(joints)
        self._path: FramePath = leg.along(self._motion.q, self._motion.qd)
        origin_ns = int(joints.clock.times_ns[0])
        self._wrench_t = seconds_since(wrench.clock.times_ns, origin_ns)
        if not (self._wrench_t[0] < self._motion.t[-1] and self._wrench_t[-1] > 0.0):
            raise SettingsError(
                f"{request.log}: joints and wrench are "
                f"{abs(self._wrench_t[0]):.0f} s apart by their {joints.clock.by}s: "
                "two clocks.",
                hint="Set both computers to one clock; --clock receipt takes the "
                "recorder's.",
            )

    def result(self, log: LogFile) -> ImportedLog:
        """Return what came of the log; raises SettingsError."""
        request = self._request
        self._say_of_channels(log)
        raw = self._raw(0.0)
        payload, estimates, rows = self._payload(raw)
        force = self._force(payload, raw)
        strokes = self._strokes(np.linalg.norm(force, axis=1))
        axes, ground = self._axes(strokes)
        lag, found = self._lag(axes, force)
        if lag:
            raw = self._raw(lag)
            payload, estimates, _ = self._payload(raw, rows)
            force = self._force(payload, raw)
        self._say_of_weight(payload.mass, strokes)
        values = traction(axes, self._path.velocity, force)
        lateral = force @ axes[1]
        checks = sign_checks(values, lateral)
        self._warnings += side_warnings(values, lateral)
        self._warnings += self._of_moments(payload, raw, values)
        self._warnings += self._of_channels(strokes)
        self._warnings += [
            text
            for a, b in strokes
            for text in way_warnings(self._path.foot[a:b], axes)
        ]
        trials = [
            replace(trial, series=replace(trial.series, is_simulated=log.is_simulated))
            for trial in self._trials(values, raw, force, float(axes[0][2]))
        ]
        return ImportedLog(
            request,
            log.format,
            self._urdf,
            self._joints,
            self._wrench,
            self._leg.joints,
            [*estimates, found, *ground],
            checks,
            trials,
            self._warnings,
            list(log.losses),
            log.is_simulated,
        )

    def _check_rates(self) -> None:
        for channel in (self._joints, self._wrench):
            step = float(np.median(np.diff(channel.clock.times_ns))) * 1e-9
            name, rate = channel.topic.name, 1.0 / step
            if rate < SLOWEST_RATE and not self._request.is_slow:
                raise SettingsError(
                    f"{self._request.log}: {name} has {rate:.1f} Hz: too slow for "
                    f"slips, {USUAL_RATE:.0f} Hz at least.",
                    hint="--slow takes it, for means only.",
                )
            if rate < USUAL_RATE * 0.99:
                self._warnings.append(
                    f"{name} has {rate:.1f} Hz: slips are not seen, means are"
                )

    def _say_of_channels(self, log: LogFile) -> None:
        """Tell what the channels lack."""
        say = self._warnings.append
        for channel in (self._joints, self._wrench):
            clock, name = channel.clock, channel.topic.name
            if clock.by == "receipt":
                say(
                    f"{name}: times of receipt, its stamps are missing or jump by "
                    f"{clock.jump:.1f} s; the lag is that of the network"
                )
            if clock.repeated:
                say(f"{name}: {clock.repeated} messages with the time of another one")
        if self._joints.incomplete:
            say(
                f"{self._joints.topic.name}: {self._joints.incomplete} messages lack a "
                "joint of the leg"
            )
        if self._motion.dropped:
            say(f"{self._motion.dropped} rows lie in gaps of the joints")
        frame = self._wrench.frame_id
        if frame and frame != self._request.sensor:
            used = self._request.sensor
            say(f"the wrench names the frame {frame[:60]!r}; {used!r} is used")
        if self._request.is_estimated:
            say("the wrench is estimated by the robot, not measured at the foot")
        say_velocities = compare_velocities(self._joints, self._motion)
        self._warnings += say_velocities
        self._warnings += log.losses

    def _raw(self, lag: float) -> Array:
        """Return the readings at the times of the joints, shape (n, 6)."""
        motion = self._motion
        at = motion.t + lag
        return mean_around(self._wrench_t, self._wrench.wrench, at, motion.step)

    def _payload(
        self, raw: Array, rows: Bools | None = None
    ) -> tuple[Payload, list[Estimate], Bools | None]:
        """Return tare and weight, and the unloaded rows that they come from."""
        tare, mass = self._request.tare, self._request.mass
        if isinstance(tare, str | np.ndarray):
            return *self._given_tare(raw, tare), None
        if isinstance(tare, Path):
            return *self._tare_of_file(tare), None
        if rows is None:
            rows = self._unloaded(raw, tare)
        bias, weight, estimates = tare_of(
            raw[rows], self._path.sensor[rows], self._sign, mass
        )
        t = self._motion.t[rows]
        how = (
            "given"
            if tare is not None
            else "quiet spans of the lifted foot, first to last row"
        )
        ends = (float(t[0]), float(t[-1]))
        span = Estimate("unloaded", ends, "s of the log", (), how)
        return self._with(bias, weight), [span, *estimates], rows

    def _with(self, bias: Array, mass: float) -> Payload:
        return Payload(mass, np.zeros(3), np.eye(3), self._sign, bias)

    def _unloaded(self, raw: Array, span: tuple[float, float] | None) -> Bools:
        t = self._motion.t
        if span is None:
            return find_unloaded(t, raw, self._path.foot[:, 2])
        rows = (t >= span[0]) & (t <= span[1]) & np.isfinite(raw).all(axis=1)
        if np.count_nonzero(rows) < 3:
            raise SettingsError(
                f"--tare {span[0]:g}:{span[1]:g} holds no readings.",
                hint=f"The log goes from 0 to {t[-1]:.1f} s.",
            )
        height = self._path.foot[:, 2]
        if float(height[rows].min() - height.min()) < _ON_GROUND:
            raise SettingsError(
                f"The foot is at its lowest place within {span[0]:g} to {span[1]:g} s: "
                "it stands on the ground, and the tare would take its load away.",
                hint="Name a span in which it is in the air, or leave --tare out.",
            )
        return rows

    def _given_tare(
        self, raw: Array, tare: Array | str
    ) -> tuple[Payload, list[Estimate]]:
        """Return a tare that was given in numbers, or that the sensor has done."""
        mass = self._request.mass or 0.0
        bias = np.zeros(6) if isinstance(tare, str) else tare
        how = "the sensor is said to be tared" if isinstance(tare, str) else "given"
        payload = self._with(bias, mass)
        try:
            rows = find_unloaded(self._motion.t, raw, self._path.foot[:, 2])
        except SettingsError:
            self._warnings.append("the tare was not checked: the foot is never free")
        else:
            rest = float(np.linalg.norm(self._force(payload, raw)[rows].mean(axis=0)))
            if rest > _FORGOTTEN:
                raise SettingsError(
                    f"The free foot reads {rest:.1f} N (limit {_FORGOTTEN:g}): a "
                    "forgotten tare or weight.",
                    hint="Leave --tare out, or give --tare T0:T1 and --tool-mass.",
                )
        weight = Estimate("mass", (mass,), "kg", (), "given" if mass else "none given")
        return payload, [
            Estimate("tare", tuple(bias.tolist()), "N, N m", (), how),
            weight,
        ]

    def _tare_of_file(self, path: Path) -> tuple[Payload, list[Estimate]]:
        if self._request.mass is not None:
            raise SettingsError(
                "--tare FILE and --tool-mass: how the sensor stood in that log is not "
                "known.",
                hint="Leave --tool-mass out, or give --tare T0:T1 of the log itself.",
            )
        readings = _readings_of(path, self._wrench, self._request.clock)
        upright = np.broadcast_to(np.eye(3), (len(readings), 3, 3))
        bias, mass, estimates = tare_of(readings, upright, self._sign, None)
        return self._with(bias, mass), estimates

    def _force(self, payload: Payload, raw: Array) -> Array:
        """Return the force of the ground on the foot in the base, shape (n, 3)."""
        sensor = self._path.sensor
        return payload.to_base(payload.contact(raw, sensor), sensor)

    def _of_moments(self, payload: Payload, raw: Array, values: Array) -> list[str]:
        """Hold the moments against the lever of the foot, in the sensor's axes."""
        wrench = payload.contact(raw, self._path.sensor)
        force, moment = wrench[:, :3], wrench[:, 3:]
        sliding = (values[:, 0] > SLOWEST) & (values[:, 2] > PRESSED_FORCE)
        doubts = free_moment(force[sliding], moment[sliding])
        found = [replace(d, remedy=_CHECK_OPTIONS).text for d in doubts]
        return [*found, *moment_warnings(moment, self._path.lever, force)]

    def _of_channels(self, strokes: list[tuple[int, int]]) -> list[str]:
        """Judge each channel of the sensor while the foot slides."""
        times, found = self._motion.t, list[FrozenChannel]()
        for first, end in strokes:
            is_in = (self._wrench_t >= times[first]) & (self._wrench_t < times[end - 1])
            readings = self._wrench.wrench[is_in]
            found += frozen_channels(self._wrench_t[is_in], readings)
        return [f"{channel.text} while the foot slides" for channel in found]

    def _strokes(self, load: Array) -> list[tuple[int, int]]:
        """Return the stretches in which something presses the foot."""
        filled = np.where(np.isfinite(load), load, 0.0)
        width = rows_averaged(self._motion.step)
        found = pressed_stretches(
            self._motion.t, moving_average(filled, width), PRESSED_FORCE, _JOIN
        )
        long = [(a, b) for a, b in found if b - a > max(width, 3)]
        if not long:
            raise SettingsError(
                f"The foot is never pressed: the largest force is {filled.max():.1f} N "
                f"(limit {PRESSED_FORCE:g}).",
                hint="Check --wrench and --tare.",
            )
        return long

    def _axes(self, strokes: Sequence[tuple[int, int]]) -> tuple[Array, list[Estimate]]:
        """Return the rows x_T, y_T, z_T in the base, and the estimates of both."""
        request, foot = self._request, self._path.foot
        pressed = np.concatenate([foot[a:b] for a, b in strokes])
        along, given = request.along, request.normal
        if request.heading_deg is not None:
            heading = np.radians(request.heading_deg)
            along = np.array([np.cos(heading), np.sin(heading), 0.0])
        if request.incline_deg is not None:
            up = np.array([0.0, 0.0, 1.0])
            level, _ = find_direction(foot, strokes, up, along)
            slope = np.radians(request.incline_deg)
            given = np.cos(slope) * up - np.sin(slope) * level
        normal, of_normal = find_ground(pressed, given)
        direction, of_direction = find_direction(foot, strokes, normal, along)
        axes = np.stack([direction, np.cross(normal, direction), normal])
        return axes, [of_normal, of_direction]

    def _lag(self, axes: Array, force: Array) -> tuple[float, Estimate]:
        """Return how late the wrench is; given, found, or 0 where it is not known."""
        given = self._request.lag
        if given is not None and abs(given) > LONGEST_LAG:
            raise SettingsError(
                f"A lag of {given * 1e3:.0f} ms is none (limit "
                f"{LONGEST_LAG * 1e3:.0f}).",
                hint="Set the clocks of both computers.",
            )
        lag = self._shown_lag(axes, force)
        if given is not None:
            self._doubt_lag(given, lag)
            return given, Estimate("lag", (given * 1e3,), "ms", (), "given")
        if lag is None:
            self._warnings.append(
                "the lag between joints and wrench is not known and taken as 0: too "
                "few starts and stops. Give --lag MS"
            )
            return 0.0, Estimate("lag", (0.0,), "ms", (), "not found, taken as 0")
        if lag.seconds > LONGEST_LAG:
            self._warnings.append(
                f"the wrench is stamped {lag.seconds * 1e3:.0f} ms late (limit "
                f"{LONGEST_LAG * 1e3:.0f}). Set the clocks of both computers"
            )
        return lag.seconds, _lag_estimate(lag)

    def _doubt_lag(self, given: float, shown: Lag | None) -> None:
        """Warn of a lag that is not that of the motion, or longer than usual."""
        if shown is not None:
            if not shown.low - SURE <= given <= shown.high + SURE:
                self._warnings.append(
                    f"a lag of {given * 1e3:.0f} ms was given; starts and stops show "
                    f"{shown.low * 1e3:.0f} to {shown.high * 1e3:.0f} ms"
                )
        elif abs(given) > _USUAL_LAG:
            self._warnings.append(
                f"a lag of {given * 1e3:.0f} ms was given; no start or stop shows it, "
                f"and one over {_USUAL_LAG * 1e3:.0f} ms is rare"
            )

    def _shown_lag(self, axes: Array, force: Array) -> Lag | None:
        """Return the lag that starts and stops show; None where they do not."""
        sound = np.isfinite(force).all(axis=1)
        t = self._motion.t
        width = rows_averaged(self._motion.step)
        v_t, F_t, F_n = traction(axes, self._path.velocity, force).T
        F_t, F_n = (
            moving_average(np.interp(t, t[sound], F[sound]), width) for F in (F_t, F_n)
        )
        return find_lag(t, v_t, F_n, F_t)

    def _say_of_weight(self, mass: float, strokes: Sequence[tuple[int, int]]) -> None:
        """Name a weight that is not known and turns with the sensor."""
        rows = np.concatenate([np.arange(a, b) for a, b in strokes])
        turned = turn_deg(self._path.sensor[rows])
        if mass == 0.0 and turned > _TURN_TOLD:
            most = (
                2.0 * np.sin(np.radians(min(turned, 180.0)) / 2.0) * GRAVITY * _LITTLE
            )
            self._warnings.append(
                f"the weight below the sensor is not known, and the sensor turns by "
                f"{turned:.0f} degrees while pressed: every {_LITTLE:g} kg left out is "
                f"{most:.2f} N. Give --tool-mass KG"
            )

    def _trials(
        self, values: Array, raw: Array, force: Array, rise: float
    ) -> list[ImportedTrial]:
        """Return the strokes in which the foot goes forward; raises SettingsError."""
        request, t = self._request, self._motion.t
        if request.trials is not None:
            parts = [
                (int(np.searchsorted(t, a)), int(np.searchsorted(t, b, "right")))
                for a, b in request.trials
            ]
        else:
            load = np.where(np.isfinite(values[:, 2]), values[:, 2], 0.0)
            parts = self._strokes(load)
        trials: list[ImportedTrial] = []
        for first, end in parts:
            v_t = values[first:end, 0]
            way = float(np.clip(v_t, 0.0, None).sum()) * self._motion.step
            if request.trials is None and way < _LEAST_WAY:
                continue
            if not (end - first > 3 and (v_t > SLOWEST).any()):
                begin = float(t[min(first, len(t) - 1)])
                raise SettingsError(
                    f"The foot never moves forward between {begin:.1f} and "
                    f"{t[end - 1]:.1f} s.",
                    hint="Check --trials and --along.",
                )
            name = f"T{len(trials) + 1:02d}"
            trials.append(
                self._trial(name, slice(first, end), values, raw, force, rise)
            )
        if not trials:
            raise SettingsError(
                f"The pressed foot never moves {_LEAST_WAY * 1e3:.0f} mm forward.",
                hint="Check --along, or name the strokes by --trials T0:T1,...",
            )
        return trials

    def _trial(
        self,
        name: str,
        rows: slice,
        values: Array,
        raw: Array,
        force: Array,
        rise: float,
    ) -> ImportedTrial:
        t = self._motion.t[rows]
        v_t, F_t, F_n = values[rows].T
        series = TractionSeries(
            terrain=self._request.terrain,
            name=name,
            t=t - t[0],
            v_t=v_t,
            F_n=F_n,
            F_t=F_t,
            incline_deg=-float(np.degrees(np.arcsin(np.clip(rise, -1.0, 1.0)))),
            factors=self._request.factors,
            is_foreign=True,
        )
        prepared = prepare_trial(series, PrepareOptions())
        for doubt in doubts_of(prepared):
            remedy = "--lag MS" if doubt.name == "lag" else _CHECK_OPTIONS
            self._warnings.append(f"{name}: {replace(doubt, remedy=remedy).text}")
        path = self._path
        return ImportedTrial(
            name,
            float(t[0]),
            t - t[0],
            self._motion.q[rows],
            raw[rows],
            path.foot[rows],
            path.velocity[rows],
            force[rows],
            values[rows],
            series,
        )


def _lag_estimate(lag: Lag) -> Estimate:
    ends = (lag.low * 1e3, lag.high * 1e3)
    return Estimate("lag", (lag.seconds * 1e3,), "ms", ends, f"{lag.how}; from, to")
