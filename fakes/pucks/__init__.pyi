from .bank import MotorSide
from .bus_faults import BusFaults
from .event_queue import FRAME_NS, OutFrame
from .ft_puck import SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS, Load
from .network import PuckNetwork
from .options import NetworkOptions
from .safety_module import NOMINAL_VOLTAGE, PendantAction
from .wire import WiredNetwork, lay_wire

__all__ = [
    "FRAME_NS",
    "NOMINAL_VOLTAGE",
    "SENSOR_FORCE_ERRORS",
    "SENSOR_TORQUE_ERRORS",
    "BusFaults",
    "Load",
    "MotorSide",
    "NetworkOptions",
    "OutFrame",
    "PendantAction",
    "PuckNetwork",
    "WiredNetwork",
    "lay_wire",
]
