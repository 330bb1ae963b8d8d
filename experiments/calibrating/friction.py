"""traction calibrate friction: turn every motor both ways, fit what resists it."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.errors import SettingsError
from acquisition.settings import read_text
from analysis.report.friction_page import FRICTION_HEADER, FrictionPage, friction_rows
from experiments.rig.build import start_of
from experiments.run.console_loop import ConsoleLoop
from experiments.run.pose_walk import PoseWalk
from experiments.run.ready import activate
from experiments.session.store import iso_utc
from wam.calibration.excitation import FrictionLeg, LegUse, plan_friction
from wam.calibration.free_space import FreeSpace
from wam.calibration.friction_file import FrictionCalibration, friction_from_toml
from wam.calibration.friction_fit import FrictionFit, check_friction, fit_friction
from wam.calibration.poses import MeasurementPose
from wam.calibration.sliding import RecordedLeg, sliding_rows
from wam.model.constants import Array
from wam.model.friction import MotorFriction

# kg m to which first moments are known: calibrated ones, and those of drawings.
_KNOWN, _DRAWN = 0.02, 0.1


@dataclass(frozen=True, slots=True)
class _RecordedWay:
    """What was recorded on the way, by its use."""

    fitted: list[RecordedLeg]
    held_out: list[RecordedLeg]


class FrictionGuide:
    """Leads the arm to and fro and identifies the friction of its motors."""

    def __init__(self, console_loop: ConsoleLoop) -> None:
        self._walk = PoseWalk(console_loop)
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

    def page(
        self,
        calibration: FrictionCalibration,
        out: Path,
        truth: MotorFriction | None,
    ) -> FrictionPage:
        """Return what stands on the page of a calibration.

        Args:
            calibration: the new one.
            out: its file; the earlier ones lie beside it, as friction*.toml.
            truth: friction of a simulated arm; None = it is a real one.
        """
        rig = self._rig
        return FrictionPage(
            model=rig.model,
            calibration=calibration,
            earlier=_earlier(calibration, out),
            terrain=rig.row.name,
            frame=rig.frame,
            start_q=start_of(rig.row, rig.model),
            truth=truth,
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
        rows = friction_rows(self._rig.model.constants, fit)
        self._console.table(list(FRICTION_HEADER), rows)
        shares = ", ".join(f"{share:.2f}" for share in fit.residual)
        self._console.say(
            f"residual on the held-out sweep, share of Coulomb friction: {shares} "
            "(motors 1 to 7)"
        )


def _earlier(now: FrictionCalibration, out: Path) -> list[FrictionCalibration]:
    """Return other calibrations of the same arm beside `out`, the oldest first."""
    calibrations: list[FrictionCalibration] = []
    for path in out.parent.glob("friction*.toml"):
        if path == out:
            continue
        with suppress(SettingsError, OSError, ValueError):
            calibrations.append(friction_from_toml(read_text(path), path.name))
    before = [
        calibration
        for calibration in calibrations
        if calibration.is_simulated == now.is_simulated
    ]
    return sorted(before, key=lambda calibration: calibration.measured_utc)
