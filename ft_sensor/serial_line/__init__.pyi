from .framing import FrameScanner, wire_time_ns
from .link import PortSettings, SerialLink, SerialPort, open_port
from .reconnect import ReconnectingSensor, stream_metadata
from .sensor import BURSTY, SerialDevice, SerialSensor
from .startup import FIRST_READINGS, SerialDialog

__all__ = [
    "BURSTY",
    "FIRST_READINGS",
    "FrameScanner",
    "PortSettings",
    "ReconnectingSensor",
    "SerialDevice",
    "SerialDialog",
    "SerialLink",
    "SerialPort",
    "SerialSensor",
    "open_port",
    "stream_metadata",
    "wire_time_ns",
]
