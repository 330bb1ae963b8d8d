from . import bus, calibration, control, driver, model

__all__ = [
    "bus",
    "calibration",
    "control",
    "driver",
    "model",
]
