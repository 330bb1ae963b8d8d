from .hub import CanPort, Frame, SocketHub
from .in_process import FakeCanBus

__all__ = [
    "CanPort",
    "FakeCanBus",
    "Frame",
    "SocketHub",
]
