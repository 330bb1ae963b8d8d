from . import calibration, serial_line, vendors
from .payload import LiveFoot, Payload, TerrainFrame, payload_of, traction
from .reading import ALL_AXES, Wrench, axis_names, largest_traction
from .section import SensorSection
from .tare import TareError, TareResult, take_mean

__all__ = [
    "ALL_AXES",
    "LiveFoot",
    "Payload",
    "SensorSection",
    "TareError",
    "TareResult",
    "TerrainFrame",
    "Wrench",
    "axis_names",
    "calibration",
    "largest_traction",
    "payload_of",
    "serial_line",
    "take_mean",
    "traction",
    "vendors",
]
