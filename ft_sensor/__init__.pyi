from . import calibration, serial_line, vendors
from .payload import LiveFoot, Payload, TerrainFrame, payload_of, traction
from .reading import ALL_AXES, Wrench, axis_names, largest_traction
from .section import SensorSection
from .tare import TareError, TareResult, WeightChange, take_mean, weight_change

__all__ = [
    "ALL_AXES",
    "LiveFoot",
    "Payload",
    "SensorSection",
    "TareError",
    "TareResult",
    "TerrainFrame",
    "WeightChange",
    "Wrench",
    "axis_names",
    "calibration",
    "largest_traction",
    "payload_of",
    "serial_line",
    "take_mean",
    "traction",
    "vendors",
    "weight_change",
]
