from . import bota, optoforce, robotous
from .barrett import BarrettSensor
from .bota import Acknowledgement, BootText, BotaFrame
from .optoforce import OptoForceFrame
from .registry import SECTIONS, AnySensor
from .robotous import MODELS, RobotousFrame

__all__ = [
    "MODELS",
    "SECTIONS",
    "Acknowledgement",
    "AnySensor",
    "BarrettSensor",
    "BootText",
    "BotaFrame",
    "OptoForceFrame",
    "RobotousFrame",
    "bota",
    "optoforce",
    "robotous",
]
