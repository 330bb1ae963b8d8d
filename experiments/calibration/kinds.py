"""The calibrations of `traction calibrate`, by name."""

from collections.abc import Mapping
from typing import Any

from experiments.calibration.calibration import GuidedCalibration
from experiments.calibration.friction import FRICTION
from experiments.calibration.gravity import GRAVITY
from experiments.calibration.sensor import FOOT, SENSOR
from experiments.calibration.terrain import TERRAIN

CALIBRATIONS: Mapping[str, GuidedCalibration[Any, Any]] = {
    calibration.name: calibration
    for calibration in (GRAVITY, FRICTION, SENSOR, FOOT, TERRAIN)
}
