"""traction calibrate sensor, foot: turn the foot to all sides, fit what it weighs."""

from collections.abc import Sequence

import numpy as np

from acquisition.errors import PreflightError
from acquisition.ipc.layout import WRENCH_SLOTS
from acquisition.sample import Record
from experiments.run.console_loop import ConsoleLoop
from experiments.run.pose_walk import PoseWalk
from experiments.run.ready import activate
from experiments.session.store import iso_utc
from ft_sensor.calibration.fit import SensorFit, check_residual, fit_sensor, turn_words
from ft_sensor.calibration.sensor_file import SensorCalibration
from wam.calibration.free_space import FreeSpace
from wam.calibration.poses import MeasurementPose, choose_orientations, plan_halts
from wam.model.constants import Array

AVERAGE = 2.0  # s of readings that are averaged in each orientation
_FEWEST = 100  # readings in an average


class SensorGuide:
    """Leads arm and foot through the orientations of a sensor's calibration."""

    def __init__(self, console_loop: ConsoleLoop) -> None:
        self._walk = PoseWalk(console_loop)
        self._rig = console_loop.rig
        self._console = console_loop.console

    def run(
        self,
        count: int,
        mounting: tuple[float, float] | None,
        poses: Sequence[Array] = (),
        *,
        is_forced: bool,
    ) -> SensorCalibration:
        """Measure in `count` orientations and return the calibration.

        The first one is measured again at the end: what has changed is drift.

        Args:
            count: how many orientations.
            poses: of a person, instead of chosen ones [rad], shape (7,) each.
            mounting: angle [rad] and sign where they are known; None = fitted too.
            is_forced: accept a fit that `check_residual` refuses.

        Raises:
            SettingsError: no safe way, or the fit is bad.
            PreflightError: not activated, touched meanwhile, or too few readings.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        model = self._rig.model

        def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
            chosen = list(poses) or choose_orientations(model, count, space)
            chosen.append(chosen[0])
            return plan_halts(model, start, chosen, space, is_two_sided=False)

        activate(self._walk.console_loop)
        measured = self._measure(self._walk.begin(plan, AVERAGE))
        self._walk.end()
        rotations = np.array([rotation for rotation, _ in measured])
        readings = np.array([reading for _, reading in measured])
        fit = fit_sensor(rotations[:-1], readings[:-1], mounting)
        drift = float(np.linalg.norm(readings[-1, :3] - readings[0, :3]))
        self._say(fit, drift)
        free = None
        if mounting is not None:
            free = fit_sensor(rotations[:-1], readings[:-1])
        else:
            self._say_mounting(fit)
        check_residual(fit, is_forced=is_forced, free=free)
        return SensorCalibration(
            fit=fit,
            foot=self._rig.row.foot,
            drift=drift,
            measured_utc=iso_utc(self._rig.clock.utc_ns()),
            is_simulated=self._rig.is_simulated,
            rotations=rotations,
            readings=readings,
            is_forced=is_forced,
        )

    def _measure(self, halts: Sequence[MeasurementPose]) -> list[tuple[Array, Array]]:
        measured: list[tuple[Array, Array]] = []
        for halt in halts:
            self._walk.go_to(halt)
            if halt.pose is None:
                continue
            q, _ = self._walk.rest(AVERAGE)
            measured.append((self._rig.model.plate_pose(q)[1], self._mean_reading()))
            self._console.say(f"orientation {len(measured)} measured")
        return measured

    def _mean_reading(self) -> Array:
        """Return the mean of the last two seconds [N, N m], shape (6,).

        Raises:
            PreflightError: too few readings, or one that is not valid.
        """
        records: Record = self._rig.shared.wrenches.last(WRENCH_SLOTS)
        since = self._rig.clock.now_ns() - int(AVERAGE * 1e9)
        records = records[records["t_ns"].astype(np.int64) >= since]
        bad = int(np.count_nonzero(~records["is_valid"] | records["saturated"]))
        if len(records) < _FEWEST or bad:
            raise PreflightError(
                f"{len(records)} readings in {AVERAGE:g} s (at least {_FEWEST}), "
                f"{bad} of them flagged.",
                hint="Check the sensor's cable and load, then start again.",
            )
        return records["wrench"].mean(axis=0)

    def _say_mounting(self, fit: SensorFit) -> None:
        """Say where the sensor is not mounted as rig.toml has it."""
        tool = self._rig.model.tool
        assert tool is not None
        if fit.sign != tool.sensor_sign:
            self._console.say(
                f"▲ rig.toml says sign {tool.sensor_sign:+z.0f}: the sensor has the "
                "other one. Its calibration goes before rig.toml."
            )
        elif turned := turn_words(tool.sensor_angle, fit.angle):
            self._console.say(
                f"▲ {turned} from angle_deg of rig.toml. Its calibration goes before "
                "rig.toml."
            )

    def _say(self, fit: SensorFit, drift: float) -> None:
        com = ", ".join(f"{1e3 * value:.1f}" for value in fit.com)
        bias = ", ".join(f"{value:.2f}" for value in fit.bias[:3])
        say = self._console.say
        say(f"mass {fit.mass:.3f} kg, centre {com} mm in the sensor frame")
        say(
            f"mounted at {np.degrees(fit.angle):.1f} degrees about z7, sign "
            f"{fit.sign:+z.0f}, bias {bias} N"
        )
        say(
            f"residual {fit.residual:.3f} N, {fit.torque_residual:.4f} N m rms; the "
            f"first orientation had changed by {drift:.2f} N at the end"
        )
