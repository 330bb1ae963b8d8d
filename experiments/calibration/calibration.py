"""What a guided calibration is, and the one way through it: `calibrate`."""

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
    """What a calibration works with.

    Attributes:
        console_loop: rig, terminal and operator together.
        pose_count: how many poses are chosen.
        poses: of a person, instead [rad], shape (7,) each; () = none.
        is_forced: keep a fit that is refused as bad.
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
        """Where everything is printed."""
        return self.console_loop.console


def _as_they_are(settings: Settings, row: TerrainRow) -> tuple[Settings, TerrainRow]:
    return settings, row


def _keep_any(context: CalibrationContext, fitted: object) -> None:
    del context, fitted


@dataclass(frozen=True, slots=True)
class GuidedCalibration(Generic[_Measured, _Fitted]):
    """One guided calibration.

    Attributes:
        name: what is calibrated, in a word.
        collect: asks for what it needs, activates the arm, lets it be moved, lays it
            down; returns what was measured.
        fit: returns what that comes to; the arm is idle. Raises SettingsError where it
            cannot be fitted.
        show: prints the result.
        text: returns the file.
        use: returns how the file of that name is put to use, in words.
        path: returns where the file goes, beside rig.toml.
        made_anew: of what a commissioning stands on, what is measured anew.
        check: raises SettingsError for a result that is not kept.
        bare: returns settings and row without the calibration that is made anew.
        fewest_poses: 0 = it takes no poses.
        truth: the same file of what is true of a simulated arm; None = not written.
    """

    name: str
    collect: Callable[[CalibrationContext], _Measured]
    fit: Callable[[CalibrationContext, _Measured], _Fitted]
    show: Callable[[CalibrationContext, _Fitted], None]
    text: Callable[[CalibrationContext, _Fitted], str]
    use: Callable[[CalibrationContext, str], str]
    path: Callable[[Settings, TerrainRow], Path]
    made_anew: Collection[str]
    check: Callable[[CalibrationContext, _Fitted], None] = _keep_any
    bare: Callable[[Settings, TerrainRow], tuple[Settings, TerrainRow]] = _as_they_are
    fewest_poses: int = 0
    truth: Callable[[CalibrationContext, _Fitted], str] | None = None

    def default_path(
        self, settings: Settings, row: TerrainRow, *, is_fake: bool
    ) -> Path:
        """Return where the file goes; what is simulated is marked."""
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
    """Collect, fit, show, and write what is not refused to `out`.

    Raises:
        SettingsError: no safe way, or the fit is bad.
        PreflightError: not activated, or measured under something that disturbs.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    measured = calibration.collect(context)
    fitted = context.console_loop.run_aside(lambda: calibration.fit(context, measured))
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
