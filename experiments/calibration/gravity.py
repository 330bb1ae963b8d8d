"""traction calibrate gravity: hold the arm in many poses, fit what it weighs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.run.console_loop import ConsoleLoop
from experiments.run.pose_walk import PoseWalk
from experiments.run.ready import activate
from experiments.session.store import iso_utc
from wam.calibration.free_space import FreeSpace
from wam.calibration.gravity_file import GravityCalibration
from wam.calibration.poses import MeasurementPose, choose_poses, plan_halts
from wam.model.constants import Array
from wam.model.moments import (
    MomentFit,
    ZeroErrors,
    check_drawings,
    check_fit,
    check_zeros,
    fit_moments,
    zero_errors,
)

AVERAGE = 0.5  # s of torques that are averaged


@dataclass(frozen=True, slots=True)
class MeasuredMoments:
    """One pose as measured.

    Attributes:
        q: mean joint positions of both approaches [rad], shape (7,).
        tau: mean torques of both: friction cancels [N m], shape (7,).
        friction: half the difference of both [N m], shape (7,).
    """

    q: Array
    tau: Array
    friction: Array


class GravityGuide:
    """Leads the arm through the poses of a gravity calibration."""

    def __init__(self, console_loop: ConsoleLoop) -> None:
        self._walk = PoseWalk(console_loop, is_free=True)
        self._rig = console_loop.rig
        self._console = console_loop.console

    def run(
        self, count: int, poses: Sequence[Array] = (), *, is_forced: bool
    ) -> GravityCalibration:
        """Measure in `count` poses and return the calibration.

        Args:
            count: how many poses are chosen.
            poses: of a person, instead [rad], shape (7,) each.
            is_forced: accept a fit that `check_fit` refuses.

        Raises:
            SettingsError: no safe way, or the fit is bad.
            PreflightError: not activated, or touched while it was weighed.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        model = self._rig.model

        def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
            chosen = poses or choose_poses(model, count, space)
            return plan_halts(model, start, chosen, space)

        activate(self._walk.console_loop)
        rests = self._measure(self._walk.begin(plan, 2 * AVERAGE))
        self._walk.end()
        return self._fit(rests, is_forced=is_forced)

    def _measure(self, halts: Sequence[MeasurementPose]) -> list[MeasuredMoments]:
        rests: dict[int, list[tuple[Array, Array]]] = {}
        for halt in halts:
            self._walk.go_to(halt)
            if halt.pose is None:
                continue
            rests.setdefault(halt.pose, []).append(self._walk.rest(AVERAGE))
            if len(rests[halt.pose]) == 2:
                self._console.say(f"pose {halt.pose + 1} measured")
        return [_both(approaches) for approaches in rests.values()]

    def _fit(
        self, measured: list[MeasuredMoments], *, is_forced: bool
    ) -> GravityCalibration:
        rig = self._rig
        q = np.array([pose.q for pose in measured])
        tau = np.array([pose.tau for pose in measured])
        fit = fit_moments(rig.model.constants, q, tau)
        self._say_residuals(fit, measured)
        zeros = zero_errors(rig.model.constants, q, fit)
        self._say_zeros(zeros)
        tool = rig.model.tool
        assert tool is not None
        if not is_forced:
            check_fit(fit)
            check_zeros(zeros)
            bodies = (tool.sensor, tool.foot)
            check_drawings(rig.model.constants, fit.mus, bodies, q)
        return GravityCalibration(
            mus=fit.mus,
            residual=fit.residual,
            rank=fit.rank,
            foot=rig.row.foot,
            tool=tool,
            measured_utc=iso_utc(rig.clock.utc_ns()),
            is_simulated=rig.is_simulated,
            poses=q,
            torques=tau,
            is_forced=is_forced,
            arm=rig.serials,
        )

    def _say_zeros(self, zeros: ZeroErrors) -> None:
        joints = [
            f"joint {joint} {error:+z.1f} ± {deviation:.1f}"
            for joint, error, deviation in zip(
                zeros.joints,
                np.degrees(zeros.errors),
                np.degrees(zeros.deviations),
                strict=True,
            )
        ]
        self._console.say(
            f"zero errors estimated from torques [degrees]: {', '.join(joints)}; "
            "joints 1, 6 and 7 are not observable"
        )

    def _say_residuals(self, fit: MomentFit, measured: list[MeasuredMoments]) -> None:
        friction = np.abs([pose.friction for pose in measured]).mean(axis=0)
        rows = [_row(str(i), rest) for i, rest in enumerate(fit.residuals, 1)]
        rows.append(_row("dry friction", friction))
        header = ["residual [N m]", *(f"joint {joint}" for joint in range(1, 8))]
        self._console.table(header, rows)
        self._console.say(
            f"rms {fit.residual:.3f} N m, rank {fit.rank} of 12, condition "
            f"{fit.condition:.1f}"
        )


def _row(name: str, values: Array) -> list[str]:
    return [name, *(f"{value:.3f}" for value in values)]


def _both(approaches: list[tuple[Array, Array]]) -> MeasuredMoments:
    (q_a, tau_a), (q_b, tau_b) = approaches
    return MeasuredMoments((q_a + q_b) / 2, (tau_a + tau_b) / 2, (tau_a - tau_b) / 2)
