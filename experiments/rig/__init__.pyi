from .backend import EXCHANGE_CYCLES
from .build import build_tool, terrain_frame
from .bus_log import logging_bus, open_bus_log
from .fake import ServedArm, build_sensor_server, build_server, compiling_words
from .foresight import (
    STUDY_DATABASE,
    ForesightSource,
    foresight_view,
    read_foresight,
    state_record,
    states_of,
)
from .law_calibrations import (
    LawCalibrations,
    friction_path,
    gravity_path,
    law_words,
    read_law_calibrations,
    twin_words,
)
from .processes import MultiProcessBackend
from .rig import FakeOptions, Rig, build_rig
from .simulation import SimulatedHand

__all__ = [
    "EXCHANGE_CYCLES",
    "STUDY_DATABASE",
    "FakeOptions",
    "ForesightSource",
    "LawCalibrations",
    "MultiProcessBackend",
    "Rig",
    "ServedArm",
    "SimulatedHand",
    "build_rig",
    "build_sensor_server",
    "build_server",
    "build_tool",
    "compiling_words",
    "foresight_view",
    "friction_path",
    "gravity_path",
    "law_words",
    "logging_bus",
    "open_bus_log",
    "read_foresight",
    "read_law_calibrations",
    "state_record",
    "states_of",
    "terrain_frame",
    "twin_words",
]
