from . import bus, ground, plant, pucks, sensor, serving, world
from .clock import SteppedClock

__all__ = [
    "SteppedClock",
    "bus",
    "ground",
    "plant",
    "pucks",
    "sensor",
    "serving",
    "world",
]
