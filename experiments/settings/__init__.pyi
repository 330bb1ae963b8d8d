from .calibrations import NOTHING, check_kind, read_calibration, with_calibrations
from .load import Settings, load_settings, read_foot
from .matrix import MatrixSettings, TerrainRow
from .origins import flatten, origin_lines
from .rig import FootSection, OperatorSection, RigSettings
from .sensor import build_device

__all__ = [
    "NOTHING",
    "FootSection",
    "MatrixSettings",
    "OperatorSection",
    "RigSettings",
    "Settings",
    "TerrainRow",
    "build_device",
    "check_kind",
    "flatten",
    "load_settings",
    "origin_lines",
    "read_calibration",
    "read_foot",
    "with_calibrations",
]
