"""traction calibrate friction: turn every motor both ways, fit what resists it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.run.console_loop import ConsoleLoop
from experiments.run.pose_walk import PoseWalk
from experiments.run.ready import activate
from experiments.session.store import iso_utc
from wam.calibration.excitation import FrictionLeg, LegUse, plan_friction
from wam.calibration.free_space import FreeSpace
from wam.calibration.friction_file import FrictionCalibration
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
from wam.model.friction import joint_coulomb

# kg m to which first moments are known: calibrated ones, and those of drawings.
_KNOWN, _DRAWN = 0.02, 0.1
_SIGMAS = 1.96
_SPEEDS = np.array([0.01, 0.05, 0.1, 0.4])  # rad/s, of the table
_HEADER = ["friction [N m]", *(f"joint {joint}" for joint in range(1, 8))]


@dataclass(frozen=True, slots=True)
class _RecordedWay:
    """What was recorded on the way, by its use."""

    fitted: list[RecordedLeg]
    held_out: list[RecordedLeg]


class FrictionGuide:
    """Leads the arm to and fro and identifies the friction of its motors."""

    def __init__(self, console_loop: ConsoleLoop) -> None:
        self._walk = PoseWalk(console_loop, is_free=True)
        self._rig = console_loop.rig
        self._console = console_loop.console

    def run(self, *, is_forced: bool) -> FrictionCalibration:
        """Go the way, fit, print, and return the calibration.

        Args:
            is_forced: accept a fit that `check_friction` refuses.

        Raises:
            SettingsError: no safe way, or the fit is bad.
            PreflightError: not activated, or something held the arm up.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        legs: list[FrictionLeg] = []

        def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
            legs.extend(plan_friction(self._rig.model, start, space))
            return [leg.halt for leg in legs]

        activate(self._walk.console_loop)
        self._walk.begin(plan, 0.0)
        recorded = self._record(legs)
        self._walk.end()
        fit = self._walk.console_loop.run_aside(lambda: self._fit(recorded))
        self._say(fit)
        if not is_forced:
            check_friction(fit)
        rig = self._rig
        return FrictionCalibration(
            fit=fit,
            foot=rig.row.foot,
            gravity=rig.settings.rig.gravity.model,
            measured_utc=iso_utc(rig.clock.utc_ns()),
            is_simulated=rig.is_simulated,
            is_forced=is_forced,
            arm=rig.serials,
        )

    def _record(self, legs: Sequence[FrictionLeg]) -> _RecordedWay:
        recorded = _RecordedWay([], [])
        clock, loop_client = self._rig.clock, self._rig.backend.loop_client
        pose: int | None = None
        for leg in legs:
            began_ns = clock.now_ns()
            self._walk.go_to(leg.halt)
            cycles = loop_client.last((clock.now_ns() - began_ns) * 1e-9)
            q, tau = cycles["position"].copy(), cycles["torque_command"].copy()
            shown = RecordedLeg(q, tau, leg.halt.speed)
            if leg.use is LegUse.HELD_OUT:
                recorded.held_out.append(shown)
            else:
                recorded.fitted.append(shown)
            if leg.halt.pose != pose and leg.halt.pose is not None:
                self._console.say(f"around pose {leg.halt.pose + 1}")
            pose = leg.halt.pose
        return recorded

    def _fit(self, recorded: _RecordedWay) -> FrictionFit:
        rig = self._rig
        is_known = rig.settings.rig.gravity.model == "calibrated"
        return fit_friction(
            rig.model.constants,
            sliding_rows(rig.model, rig.law_model, recorded.fitted),
            sliding_rows(rig.model, rig.law_model, recorded.held_out),
            np.full(21, _KNOWN if is_known else _DRAWN),
        )

    def _say(self, fit: FrictionFit) -> None:
        rows = _rows(self._rig.model.constants, fit)
        self._console.table(_HEADER, rows)
        shares = ", ".join(f"{share:.2f}" for share in fit.residual)
        self._console.say(
            f"residual on the held-out sweep, share of Coulomb friction: {shares} "
            "(motors 1 to 7)"
        )


def _rows(constants: ArmConstants, fit: FrictionFit) -> list[list[str]]:
    """Return the friction of the joints [N m], a row of eight cells for each measure.

    The first cell is the name, the others are joints 1 to 7.
    """
    friction = fit.friction
    deviation = _SIGMAS * joint_deviation(constants, fit.deviation)
    rows = [
        _row("Coulomb", joint_coulomb(constants, friction.coulomb)),
        _row("  ± (95 %)", deviation),
        _row("asymmetry", joint_asymmetry(constants, friction.asymmetry)),
        _row("break-away", joint_breakaway(constants, friction)),
    ]
    curves = [speed_curve(constants, friction, j, _SPEEDS) for j in range(7)]
    for speed, torques in zip(_SPEEDS, np.array(curves).T, strict=True):
        rows.append(_row(f"at {speed:g} rad/s", torques))
    return rows


def _row(name: str, values: Array) -> list[str]:
    return [name, *(f"{value:.3f}" for value in values)]
