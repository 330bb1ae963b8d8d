"""traction calibrate gravity: hold the arm in many poses, fit its first moments."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.calibration.calibration import CalibrationContext, GuidedCalibration
from experiments.calibration.joint_table import show_joints
from experiments.calibration.pose_arrivals import arrivals
from experiments.operator.console import Console
from experiments.rig.law_calibrations import gravity_path
from experiments.run.pose_walk import PoseWalk
from experiments.session.store import iso_utc
from wam.calibration.free_space import FreeSpace
from wam.calibration.gravity_file import GravityCalibration, gravity_to_toml
from wam.calibration.poses import MeasurementPose, choose_poses, plan_waypoints
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

AVERAGE = 0.5  # s, averaging time of torques


@dataclass(frozen=True, slots=True)
class MeasuredMoments:
    """Measurements in n poses.

    Attributes:
        q: mean joint positions of both approaches [rad], shape (n, 7).
        tau: mean torques of both, so that friction cancels [N m], shape (n, 7).
        friction: half the difference of both torques [N m], shape (n, 7).
    """

    q: Array
    tau: Array
    friction: Array


@dataclass(frozen=True, slots=True)
class GravityResult:
    """Result of the gravity calibration.

    Attributes:
        measured: the measurements.
        fit: first moments.
        zeros: zero errors of the joints, as far as observable from torques.
    """

    measured: MeasuredMoments
    fit: MomentFit
    zeros: ZeroErrors


def collect(context: CalibrationContext) -> MeasuredMoments:
    """Approach each pose from two sides; returns the holding torques.

    Raises:
        SettingsError: there is no safe path.
        PreflightError: the arm was not activated, or was touched.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    model = context.rig.model

    def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
        chosen = context.poses or choose_poses(model, context.pose_count, space)
        return plan_waypoints(model, start, chosen, space)

    walk = PoseWalk(context.console_loop, is_free=True)
    rests: dict[int, list[tuple[Array, Array]]] = {}
    for arrival in arrivals(walk, plan, 2 * AVERAGE):
        pose = arrival.halt.pose
        if pose is None:
            continue
        rests.setdefault(pose, []).append(walk.rest(AVERAGE))
        if len(rests[pose]) == 2:
            context.console.say(f"pose {pose + 1} measured")
    return _combine_approaches(list(rests.values()))


def _combine_approaches(
    rests: Sequence[Sequence[tuple[Array, Array]]],
) -> MeasuredMoments:
    q, tau = (
        np.array([[approach[part] for approach in pose] for pose in rests])
        for part in (0, 1)
    )
    return MeasuredMoments(
        (q[:, 0] + q[:, 1]) / 2,
        (tau[:, 0] + tau[:, 1]) / 2,
        (tau[:, 0] - tau[:, 1]) / 2,
    )


def fit(context: CalibrationContext, measured: MeasuredMoments) -> GravityResult:
    """Fit first moments, and the zeros of the joints to their residuals."""
    constants = context.rig.model.constants
    moments = fit_moments(constants, measured.q, measured.tau)
    return GravityResult(measured, moments, zero_errors(constants, measured.q, moments))


def show(context: CalibrationContext, weighed: GravityResult) -> None:
    """Print residuals, dry friction and zero errors."""
    _show_residuals(context.console, weighed.fit, weighed.measured)
    _show_zeros(context.console, weighed.zeros)


def _show_residuals(
    console: Console, moments: MomentFit, measured: MeasuredMoments
) -> None:
    rows = [(str(i), values) for i, values in enumerate(moments.residuals, 1)]
    rows.append(("dry friction", np.abs(measured.friction).mean(axis=0)))
    show_joints(console, "residual [N m]", rows)
    console.say(
        f"rms {moments.residual:.3f} N m, rank {moments.rank} of 12, condition "
        f"{moments.condition:.1f}"
    )


def _show_zeros(console: Console, zeros: ZeroErrors) -> None:
    joints = [
        f"joint {joint} {error:+z.1f} ± {deviation:.1f}"
        for joint, error, deviation in zip(
            zeros.joints,
            np.degrees(zeros.errors),
            np.degrees(zeros.deviations),
            strict=True,
        )
    ]
    console.say(
        f"zero errors estimated from torques [degrees]: {', '.join(joints)}; "
        "joints 1, 6 and 7 are not observable"
    )


def check(context: CalibrationContext, weighed: GravityResult) -> None:
    """Refuse a bad fit, a joint zeroed elsewhere, or another tool.

    Raises:
        SettingsError: one of these, unless forced.
    """
    if context.is_forced:
        return
    model, q = context.rig.model, weighed.measured.q
    tool = model.tool
    assert tool is not None
    check_fit(weighed.fit)
    check_zeros(weighed.zeros)
    check_drawings(model.constants, weighed.fit.mus, (tool.sensor, tool.foot), q)


def text(context: CalibrationContext, weighed: GravityResult) -> str:
    """Return gravity.toml."""
    rig, measured, moments = context.rig, weighed.measured, weighed.fit
    tool = rig.model.tool
    assert tool is not None
    return gravity_to_toml(
        GravityCalibration(
            mus=moments.mus,
            residual=moments.residual,
            rank=moments.rank,
            foot=rig.row.foot,
            tool=tool,
            measured_utc=iso_utc(rig.clock.utc_ns()),
            is_simulated=rig.is_simulated,
            poses=measured.q,
            torques=measured.tau,
            is_forced=context.is_forced,
            arm=rig.serials,
        )
    )


GRAVITY = GuidedCalibration(
    "gravity",
    collect,
    fit,
    show,
    text,
    use=lambda _, name: f'[gravity] model = "calibrated", file = "{name}" of rig.toml',
    path=lambda settings, _: gravity_path(settings),
    made_anew=("[gravity]", "[friction]"),
    check=check,
    bare=lambda settings, row: (settings.with_cad_gravity().without_friction(), row),
    fewest_poses=3,
)
