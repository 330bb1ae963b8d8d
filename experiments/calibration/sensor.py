"""traction calibrate sensor, foot: turn the foot to all sides, fit its weight.

`sensor` fits the mounting of the sensor too; `foot` is for another foot on a sensor
whose mounting is known.
"""

from dataclasses import dataclass

import numpy as np

from acquisition.errors import PreflightError
from acquisition.ipc.layout import WRENCH_SLOTS
from acquisition.sample import Record
from experiments.calibration.calibration import CalibrationContext, GuidedCalibration
from experiments.calibration.pose_arrivals import arrivals
from experiments.rig.rig import Rig
from experiments.run.pose_walk import PoseWalk
from experiments.session.store import iso_utc
from ft_sensor.calibration.fit import SensorFit, check_residual, fit_sensor, turn_text
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_to_toml
from wam.calibration.free_space import FreeSpace
from wam.calibration.poses import MeasurementPose, choose_orientations, plan_waypoints
from wam.model.constants import Array
from wam.model.tool import Tool

AVERAGE = 2.0  # s, averaging time in each orientation
_FEWEST = 100  # readings in an average


@dataclass(frozen=True, slots=True)
class MeasuredOrientations:
    """Measurements in n orientations of the foot; the last repeats the first.

    Attributes:
        rotations: orientations of frame 7 in the base frame, shape (n, 3, 3).
        readings: mean raw readings [N, N m], shape (n, 6).
    """

    rotations: Array
    readings: Array

    @property
    def drift(self) -> float:
        """Change of the force between first and last orientation [N]."""
        forces = self.readings[:, :3]
        return float(np.linalg.norm(forces[-1] - forces[0]))

    def fit(self, mounting: tuple[float, float] | None = None) -> SensorFit:
        """Fit the load of the sensor, and its mounting if not given."""
        return fit_sensor(self.rotations[:-1], self.readings[:-1], mounting)


@dataclass(frozen=True, slots=True)
class FootResult:
    """Result of the sensor or foot calibration.

    Attributes:
        measured: the measurements.
        fit: foot and mounting.
        free: fit with free mounting, if that of `fit` was given.
    """

    measured: MeasuredOrientations
    fit: SensorFit
    free: SensorFit | None = None


def collect(context: CalibrationContext) -> MeasuredOrientations:
    """Turn the foot to all sides; returns the readings of the sensor.

    The first orientation is repeated at the end to measure drift.

    Raises:
        SettingsError: there is no safe path.
        PreflightError: the arm was not activated or was touched, or too few readings.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    rig, model = context.rig, context.rig.model

    def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
        count = context.pose_count
        chosen = list(context.poses) or choose_orientations(model, count, space)
        chosen.append(chosen[0])
        return plan_waypoints(model, start, chosen, space, is_two_sided=False)

    walk = PoseWalk(context.console_loop)
    rotations: list[Array] = []
    readings: list[Array] = []
    for arrival in arrivals(walk, plan, AVERAGE):
        if arrival.halt.pose is None:
            continue
        q, _ = walk.rest(AVERAGE)
        rotations.append(model.plate_pose(q)[1])
        readings.append(_mean_reading(rig))
        context.console.say(f"orientation {len(readings)} measured")
    return MeasuredOrientations(np.array(rotations), np.array(readings))


def _mean_reading(rig: Rig) -> Array:
    """Mean reading of the last two seconds [N, N m], shape (6,).

    Raises:
        PreflightError: too few readings, or an invalid one.
    """
    records: Record = rig.shared.wrenches.last(WRENCH_SLOTS)
    since = rig.clock.now_ns() - int(AVERAGE * 1e9)
    records = records[records["t_ns"].astype(np.int64) >= since]
    bad = int(np.count_nonzero(~records["is_valid"] | records["saturated"]))
    if len(records) < _FEWEST or bad:
        raise PreflightError(
            f"{len(records)} readings in {AVERAGE:g} s (at least {_FEWEST}), "
            f"{bad} of them flagged.",
            hint="Check the sensor's cable and load, then start again.",
        )
    return records["wrench"].mean(axis=0)


def _tool(context: CalibrationContext) -> Tool:
    tool = context.rig.model.tool
    assert tool is not None
    return tool


def fit(context: CalibrationContext, measured: MeasuredOrientations) -> FootResult:
    """Fit foot and mounting.

    Raises:
        SettingsError: too few or too similar orientations, or constant readings.
    """
    del context
    return FootResult(measured, measured.fit())


def fit_foot(context: CalibrationContext, measured: MeasuredOrientations) -> FootResult:
    """Fit a foot on a sensor mounted as in rig.toml; raises as `fit`."""
    tool = _tool(context)
    mounted = measured.fit((tool.sensor_angle, tool.sensor_sign))
    return FootResult(measured, mounted, measured.fit())


def show_foot(context: CalibrationContext, weighed: FootResult) -> None:
    """Print the load of the sensor, its mounting, and the residuals."""
    fitted, say = weighed.fit, context.console.say
    com = ", ".join(f"{1e3 * value:.1f}" for value in fitted.com)
    bias = ", ".join(f"{value:.2f}" for value in fitted.bias[:3])
    say(f"mass {fitted.mass:.3f} kg, centre {com} mm in the sensor frame")
    say(
        f"mounted at {np.degrees(fitted.angle):.1f} degrees about z7, sign "
        f"{fitted.sign:+z.0f}, bias {bias} N"
    )
    say(
        f"residual {fitted.residual:.3f} N, {fitted.torque_residual:.4f} N m rms; the "
        f"first orientation had changed by {weighed.measured.drift:.2f} N at the end"
    )


def show(context: CalibrationContext, weighed: FootResult) -> None:
    """Print `show_foot`, and how the mounting differs from rig.toml."""
    show_foot(context, weighed)
    tool, fitted = _tool(context), weighed.fit
    if fitted.sign != tool.sensor_sign:
        context.console.say(
            f"▲ rig.toml says sign {tool.sensor_sign:+z.0f}: the sensor has the "
            "other one. Its calibration goes before rig.toml."
        )
    elif turned := turn_text(tool.sensor_angle, fitted.angle):
        context.console.say(
            f"▲ {turned} from angle_deg of rig.toml. Its calibration goes before "
            "rig.toml."
        )


def check(context: CalibrationContext, weighed: FootResult) -> None:
    """Refuse a fit with large residuals.

    Raises:
        SettingsError: the residuals are too large, unless forced.
    """
    check_residual(weighed.fit, is_forced=context.is_forced, free=weighed.free)


def text(context: CalibrationContext, weighed: FootResult) -> str:
    """Return the calibration of the sensor, or of a foot, as TOML."""
    rig, measured = context.rig, weighed.measured
    return sensor_to_toml(
        SensorCalibration(
            fit=weighed.fit,
            foot=rig.row.foot,
            drift=measured.drift,
            measured_utc=iso_utc(rig.clock.utc_ns()),
            is_simulated=rig.is_simulated,
            rotations=measured.rotations,
            readings=measured.readings,
            is_forced=context.is_forced,
        )
    )


SENSOR = GuidedCalibration(
    "sensor",
    collect,
    fit,
    show,
    text,
    use=lambda _, name: f'calibration = "{name}" in [ft_sensor] of rig.toml',
    path=lambda settings, _: settings.folder / "ft_sensor.toml",
    made_anew=("[ft_sensor]", "[feet]"),
    check=check,
    bare=lambda settings, row: (
        settings.without_sensor(row.foot, is_mounted=False),
        row,
    ),
    fewest_poses=6,
)
FOOT = GuidedCalibration(
    "foot",
    collect,
    fit_foot,
    show_foot,
    text,
    use=lambda context, name: (
        f'calibration = "{name}" in [feet.{context.rig.row.foot}] of rig.toml'
    ),
    path=lambda settings, row: settings.folder / f"foot_{row.foot}.toml",
    made_anew=("[feet]",),
    check=check,
    bare=lambda settings, row: (
        settings.without_sensor(row.foot, is_mounted=True),
        row,
    ),
    fewest_poses=6,
)
