"""C13: the touched container compared with the row of the matrix, arm floating.

The first step in which a person leads the foot under gravity compensation: it
requires C0 to C11.
"""

import numpy as np

from acquisition.errors import SettingsError
from experiments.calibration.calibration import CalibrationContext
from experiments.calibration.terrain import TERRAIN
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import Judgement, judge_quantity, judged
from experiments.commissioning.recording import Values, number
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from ft_sensor.calibration.fit import fit_terrain
from ft_sensor.payload import TerrainFrame
from wam.model.constants import Array


def collect(scene: Scene) -> Values:
    """Have the corners touched; returns the points and the row's frame.

    Raises:
        PreflightError: not activated.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    row, frame = scene.rig.row, scene.rig.frame
    scene.say(
        f"Put up the container of {row.name} as its row says: incline "
        f"{row.incline_deg:g} degrees, heading {row.heading_deg:g}."
    )
    with scene.followed():
        points = TERRAIN.collect(CalibrationContext(scene.console_loop))
    return recorded(np.array(points), frame)


def recorded(points: Array, frame: TerrainFrame) -> Values:
    """Return the values of the step: touched `points` [m], shape (n, 3), and frame."""
    return {
        "points": points,
        "incline": np.array(frame.incline),
        "heading": np.array(frame.heading),
        "far_end": np.array(frame.start),
        "travel": np.array(frame.travel),
    }


def judge(values: Values) -> Judgement:
    """Judge the touched container against the row of the matrix."""
    try:
        fit = fit_terrain(values["points"])
    except SettingsError as error:
        return judged([judge_quantity("corners", 0.0, text=error.message)])
    touched, far_end = fit.frame, values["far_end"]
    difference = touched.heading - number(values, "heading")
    turned = (difference + np.pi) % (2.0 * np.pi) - np.pi
    tilted = touched.incline - number(values, "incline")
    away = float(np.linalg.norm(np.subtract(touched.start, far_end)))
    return judged(
        [
            judge_quantity("corners", 1.0, text=""),
            judge_quantity("flat", 1e3 * fit.residual),
            judge_quantity("incline", float(np.degrees(tilted))),
            judge_quantity("heading", float(np.degrees(turned))),
            judge_quantity("far_end", 1e3 * away),
            judge_quantity("short", 1e3 * (number(values, "travel") - touched.travel)),
        ]
    )


CONTAINER = Step(
    StepId.CONTAINER,
    collect,
    judge,
    minutes=5,
    remedy="Correct the terrain's row of the matrix, or put the container where it "
    "says.",
    needs_loop=True,
    needs_zero=True,
    needs_torque=True,
)
