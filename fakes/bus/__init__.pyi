from .adapter import CanPort
from .hub import Frame, SocketHub
from .in_process import FakeCanBus

__all__ = [
    "CanPort",
    "FakeCanBus",
    "Frame",
    "SocketHub",
]
