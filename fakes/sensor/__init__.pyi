from .errors import FORCE_ERRORS, NO_SHIFT, TORQUE_ERRORS, SensorErrors
from .kinds import SensorChoice, draw_errors, make_stream
from .port import FakeSerialPort
from .pty import SerialPty
from .stream import SensorStream, Source

__all__ = [
    "FORCE_ERRORS",
    "NO_SHIFT",
    "TORQUE_ERRORS",
    "FakeSerialPort",
    "SensorChoice",
    "SensorErrors",
    "SensorStream",
    "SerialPty",
    "Source",
    "draw_errors",
    "make_stream",
]
