from .backend import EXCHANGE_CYCLES
from .build import build_tool, terrain_frame
from .bus_log import logging_bus, open_bus_log
from .fake import ServedArm, build_sensor_server, build_server
from .gravity import gravity_path, gravity_words, read_gravity
from .processes import MultiProcessBackend
from .rig import FakeOptions, Rig, build_rig
from .simulation import SimulatedHand

__all__ = [
    "EXCHANGE_CYCLES",
    "FakeOptions",
    "MultiProcessBackend",
    "Rig",
    "ServedArm",
    "SimulatedHand",
    "build_rig",
    "build_sensor_server",
    "build_server",
    "build_tool",
    "gravity_path",
    "gravity_words",
    "logging_bus",
    "open_bus_log",
    "read_gravity",
    "terrain_frame",
]
