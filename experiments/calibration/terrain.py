"""traction calibrate terrain: touch the container with the sole, fit its frame."""

from dataclasses import dataclass

import numpy as np

from acquisition.sample import Record
from experiments.calibration.calibration import CalibrationContext, GuidedCalibration
from experiments.calibration.touching import floating_arm, touch
from experiments.run.console_loop import ConsoleLoop
from experiments.session.store import iso_utc
from experiments.settings.calibrations import FORCED
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from ft_sensor.calibration.files import terrain_to_toml
from ft_sensor.calibration.fit import (
    CORNERS,
    ContainerFit,
    check_terrain,
    fit_terrain,
    has_other_incline,
)
from wam.model.constants import Array

MOST = 60  # points


@dataclass(frozen=True, slots=True)
class TouchedContainer:
    """A touched container.

    Attributes:
        fit: its frame.
        points: positions of the sole, base frame [m], shape (3,) each.
    """

    fit: ContainerFit
    points: list[Array]


def collect(context: CalibrationContext) -> list[Array]:
    """Have the corners touched; returns the points [m], shape (3,) each.

    Raises:
        PreflightError: the arm was not activated.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    with floating_arm(context.console_loop):
        return _points(context.console_loop)


def _points(console_loop: ConsoleLoop) -> list[Array]:
    points: list[Array] = []
    while len(points) < MOST:
        number = len(points) + 1
        is_corner = number <= len(CORNERS)
        place = f"the {CORNERS[number - 1]} corner" if is_corner else "one more point"
        done = "" if is_corner else ", [d] when done"
        console_loop.console.say(
            f"Touch {place} with the sole, then [space]{done}.   (far left = "
            "away from the arm, its left)"
            if number == 1
            else f"Touch {place} with the sole, then [space]{done}."
        )
        point = touch(console_loop, number, _position, may_end=not is_corner)
        if point is None:
            break
        points.append(point)
    return points


def _position(at_rest: Record) -> Array:
    return at_rest["foot_position"].mean(axis=0)


def fit(context: CalibrationContext, points: list[Array]) -> TouchedContainer:
    """Fit the frame of the container.

    Raises:
        SettingsError: the corners do not form a container.
    """
    del context
    return TouchedContainer(fit_terrain(np.array(points)), points)


def show(context: CalibrationContext, touched: TouchedContainer) -> None:
    """Print the frame, compared with the row of the matrix."""
    fitted, row, say = touched.fit, context.rig.row, context.console.say
    frame = fitted.frame
    x, y, z = frame.start
    say(
        f"incline {np.degrees(frame.incline):.2f} degrees (matrix "
        f"{row.incline_deg:g}), heading {np.degrees(frame.heading):.2f} (matrix "
        f"{row.heading_deg:g}), across {np.degrees(fitted.roll):+z.2f}"
    )
    say(f"far end {x:.3f}, {y:.3f}, {z:.3f} m, travel {frame.travel:.3f} m")
    off = 1e3 * fitted.residual
    say(f"{len(touched.points)} points, {off:.1f} mm rms off the plane")


def check(context: CalibrationContext, touched: TouchedContainer) -> None:
    """Refuse a container whose incline differs from that of its row.

    Raises:
        SettingsError: it differs, unless forced.
    """
    check_terrain(touched.fit, context.rig.frame, is_forced=context.is_forced)


def text(context: CalibrationContext, touched: TouchedContainer) -> str:
    """Return the frame of the container as TOML."""
    rig, fitted = context.rig, touched.fit
    fields = {
        "simulated": str(rig.is_simulated).lower(),
        FORCED: str(has_other_incline(fitted, rig.frame)).lower(),
        "measured_utc": iso_utc(rig.clock.utc_ns()),
        "residual": f"{fitted.residual:.6f}",
        "roll": f"{fitted.roll:.6f}",
        "points": str([point.tolist() for point in touched.points]),
    }
    return terrain_to_toml(rig.row.name, fitted.frame, fields)


def bare(settings: Settings, row: TerrainRow) -> tuple[Settings, TerrainRow]:
    """Return settings and row as in the matrix, without the old calibration."""
    drawn = row.as_container().model_copy(update={"calibration": None})
    return settings.with_row(drawn), drawn


TERRAIN = GuidedCalibration(
    "terrain",
    collect,
    fit,
    show,
    text,
    use=lambda context, name: (
        f'calibration = "{name}" in the row of {context.rig.row.name} of matrix.toml'
    ),
    path=lambda settings, row: settings.folder / f"terrain_{row.name}.toml",
    made_anew=(),
    check=check,
    bare=bare,
)
