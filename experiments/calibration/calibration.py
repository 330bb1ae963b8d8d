"""Guided calibrations: `GuidedCalibration` and its execution by `calibrate`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from experiments.operator.console import Console
from experiments.rig.rig import Rig
from experiments.run.console_loop import ConsoleLoop
from experiments.session.data_files import write_new_text
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from wam.model.constants import Array

_Measured = TypeVar("_Measured")
_Fitted = TypeVar("_Fitted")


@dataclass(frozen=True, slots=True)
class CalibrationContext:
    """Context of a calibration.

    Attributes:
        console_loop: rig, terminal and operator together.
        pose_count: number of poses to choose.
        poses: poses from a file instead [rad], shape (7,) each; () = none.
        is_forced: write a fit that would be refused.
    """

    console_loop: ConsoleLoop
    pose_count: int = 0
    poses: Sequence[Array] = ()
    is_forced: bool = False

    @property
    def rig(self) -> Rig:
        """The rig, its loop running."""
        return self.console_loop.rig

    @property
    def console(self) -> Console:
        """The console of the loop."""
        return self.console_loop.console


def _unchanged(settings: Settings, row: TerrainRow) -> tuple[Settings, TerrainRow]:
    return settings, row


def _accept_any(context: CalibrationContext, fitted: object) -> None:
    del context, fitted


@dataclass(frozen=True, slots=True)
class GuidedCalibration(Generic[_Measured, _Fitted]):
    """One guided calibration.

    Attributes:
        name: calibrated quantity, one word.
        collect: measures with operator and arm, which is laid down at the end.
        fit: fits the measurement, the arm idle; raises SettingsError if that fails.
        show: prints the result.
        text: returns the content of the file.
        use: returns how to use the file of that name, as text.
        path: returns the path of the file, in the folder of rig.toml.
        made_anew: inputs of the commissioning that are measured again.
        check: raises SettingsError for a result that must not be written.
        bare: returns settings and row without the old calibration.
        fewest_poses: least number of poses; 0 = takes no poses.
        truth: returns the file of the true values of a simulated arm; None = none.
    """

    name: str
    collect: Callable[[CalibrationContext], _Measured]
    fit: Callable[[CalibrationContext, _Measured], _Fitted]
    show: Callable[[CalibrationContext, _Fitted], None]
    text: Callable[[CalibrationContext, _Fitted], str]
    use: Callable[[CalibrationContext, str], str]
    path: Callable[[Settings, TerrainRow], Path]
    made_anew: Collection[str]
    check: Callable[[CalibrationContext, _Fitted], None] = _accept_any
    bare: Callable[[Settings, TerrainRow], tuple[Settings, TerrainRow]] = _unchanged
    fewest_poses: int = 0
    truth: Callable[[CalibrationContext, _Fitted], str] | None = None

    def default_path(
        self, settings: Settings, row: TerrainRow, *, is_fake: bool
    ) -> Path:
        """Return the path of the file; simulated ones are marked."""
        path = self.path(settings, row)
        if not is_fake or path.stem.endswith(".fake"):
            return path
        return path.with_name(f"{path.stem}.fake{path.suffix}")

    def files(self, out: Path, *, is_fake: bool) -> list[Path]:
        """Return all files that are written with `out`."""
        is_true_known = self.truth is not None and is_fake
        return [out, _truth_path(out)] if is_true_known else [out]


def calibrate(
    calibration: GuidedCalibration[_Measured, _Fitted],
    context: CalibrationContext,
    out: Path,
) -> None:
    """Collect, fit, show and check, then write to `out`.

    Raises:
        SettingsError: there is no safe path, or the fit is bad.
        PreflightError: the arm was not activated, or the measurement was disturbed.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    measured = calibration.collect(context)
    fitted = context.console_loop.run_in_background(
        lambda: calibration.fit(context, measured)
    )
    calibration.show(context, fitted)
    calibration.check(context, fitted)
    write_new_text(out, calibration.text(context, fitted))
    say = context.console.say
    say(f"Written: {out}. To use it: {calibration.use(context, out.name)}.")
    if calibration.truth is not None and context.rig.simulation is not None:
        path = _truth_path(out)
        write_new_text(path, calibration.truth(context, fitted))
        say(f"True {calibration.name} of the simulated arm: {path}.")


def _truth_path(out: Path) -> Path:
    return out.with_name(f"{out.name.split('.')[0]}.truth{out.suffix}")
