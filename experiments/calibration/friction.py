"""traction calibrate friction: turn every motor both ways, fit its friction."""

from dataclasses import dataclass

import numpy as np

from experiments.calibration.calibration import CalibrationContext, GuidedCalibration
from experiments.calibration.joint_table import show_joints
from experiments.calibration.pose_arrivals import arrivals
from experiments.rig.law_calibrations import friction_path
from experiments.run.pose_walk import PoseWalk
from experiments.session.store import iso_utc
from wam.calibration.excitation import CENTRES, FrictionLeg, LegPurpose, plan_friction
from wam.calibration.free_space import FreeSpace
from wam.calibration.friction_file import (
    FrictionCalibration,
    friction_to_toml,
    truth_to_toml,
)
from wam.calibration.friction_fit import FrictionFit, check_friction, fit_friction
from wam.calibration.joint_friction import (
    joint_asymmetry,
    joint_breakaway,
    joint_deviation,
    speed_curve,
)
from wam.calibration.poses import MeasurementPose
from wam.calibration.sliding import RecordedLeg, sliding_rows
from wam.model.constants import ArmConstants, Array
from wam.model.friction import friction_of, joint_coulomb

# Uncertainty of first moments [kg m]: calibrated, and from the drawings.
_KNOWN, _DRAWN = 0.02, 0.1
_SIGMAS = 1.96
_SPEEDS = np.array([0.01, 0.05, 0.1, 0.4])  # rad/s, columns of the table


@dataclass(frozen=True, slots=True)
class RecordedLegs:
    """Recorded legs, by their use."""

    fitted: list[RecordedLeg]
    held_out: list[RecordedLeg]


def collect(context: CalibrationContext) -> RecordedLegs:
    """Turn every motor to and fro, slow and fast; returns all legs.

    Raises:
        SettingsError: there is no safe path.
        PreflightError: the arm was not activated, or was obstructed.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    rig, say = context.rig, context.console.say
    say(f"Back and forth about {CENTRES} poses, each motor slow and fast.")
    legs: list[FrictionLeg] = []

    def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
        legs.extend(plan_friction(rig.model, start, space))
        return [leg.waypoint for leg in legs]

    walk = PoseWalk(context.console_loop, is_free=True)
    recorded = RecordedLegs([], [])
    pose: int | None = None
    for number, arrival in enumerate(arrivals(walk, plan, 0.0)):
        halt = arrival.halt
        cycles = rig.backend.loop_client.last(arrival.seconds)
        q, tau = cycles["position"].copy(), cycles["torque_command"].copy()
        is_held_out = legs[number].use is LegPurpose.HELD_OUT
        kept = recorded.held_out if is_held_out else recorded.fitted
        kept.append(RecordedLeg(q, tau, halt.speed))
        if halt.pose != pose and halt.pose is not None:
            say(f"around pose {halt.pose + 1}")
        pose = halt.pose
    return recorded


def fit(context: CalibrationContext, recorded: RecordedLegs) -> FrictionFit:
    """Fit the friction of the motors, and evaluate it on the held-out legs."""
    rig = context.rig
    is_calibrated = rig.settings.rig.gravity.model == "calibrated"
    return fit_friction(
        rig.model.constants,
        sliding_rows(rig.model, rig.law_model, recorded.fitted),
        sliding_rows(rig.model, rig.law_model, recorded.held_out),
        np.full(21, _KNOWN if is_calibrated else _DRAWN),
    )


def show(context: CalibrationContext, fitted: FrictionFit) -> None:
    """Print the friction of the joints, and the residuals of the held-out sweep."""
    rows = _rows(context.rig.model.constants, fitted)
    show_joints(context.console, "friction [N m]", rows)
    shares = ", ".join(f"{share:.2f}" for share in fitted.residual)
    context.console.say(
        f"residual on the held-out sweep, share of Coulomb friction: {shares} "
        "(motors 1 to 7)"
    )


def _rows(constants: ArmConstants, fitted: FrictionFit) -> list[tuple[str, Array]]:
    """Rows of the friction of the joints [N m], shape (7,) each."""
    friction = fitted.friction
    curves = [speed_curve(constants, friction, j, _SPEEDS) for j in range(7)]
    return [
        ("Coulomb", joint_coulomb(constants, friction.coulomb)),
        ("  ± (95 %)", _SIGMAS * joint_deviation(constants, fitted.deviation)),
        ("asymmetry", joint_asymmetry(constants, friction.asymmetry)),
        ("break-away", joint_breakaway(constants, friction)),
        *(
            (f"at {speed:g} rad/s", torques)
            for speed, torques in zip(_SPEEDS, np.array(curves).T, strict=True)
        ),
    ]


def check(context: CalibrationContext, fitted: FrictionFit) -> None:
    """Refuse a fit that predicts the held-out legs badly.

    Raises:
        SettingsError: it does, unless forced.
    """
    if not context.is_forced:
        check_friction(fitted)


def text(context: CalibrationContext, fitted: FrictionFit) -> str:
    """Return friction.toml."""
    rig = context.rig
    calibration = FrictionCalibration(
        fit=fitted,
        foot=rig.row.foot,
        gravity=rig.settings.rig.gravity.model,
        measured_utc=iso_utc(rig.clock.utc_ns()),
        is_simulated=rig.is_simulated,
        is_forced=context.is_forced,
        arm=rig.serials,
    )
    return friction_to_toml(calibration, rig.model.constants)


def truth(context: CalibrationContext, fitted: FrictionFit) -> str:
    """Return the true friction of a simulated arm, at the loads of the fit."""
    rig = context.rig
    assert rig.simulation is not None
    true = friction_of(rig.simulation.friction())
    return truth_to_toml(true, fitted.friction.load_at, rig.model.constants)


FRICTION = GuidedCalibration(
    "friction",
    collect,
    fit,
    show,
    text,
    use=lambda _, name: f'[friction] model = "calibrated", file = "{name}" of rig.toml',
    path=lambda settings, _: friction_path(settings),
    made_anew=("[friction]",),
    check=check,
    bare=lambda settings, row: (settings.without_friction(), row),
    truth=truth,
)
