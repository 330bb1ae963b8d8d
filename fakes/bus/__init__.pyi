from .hub import CanPort, Frame, SocketHub
from .in_process import FakeCanBus, InProcessDoor

__all__ = [
    "CanPort",
    "FakeCanBus",
    "Frame",
    "InProcessDoor",
    "SocketHub",
]
