from .home_arm import HomePose, build_home_server
from .puck_server import PuckServer, open_can_port
from .sensor_server import SensorLine, SensorServer, hanging_load

__all__ = [
    "HomePose",
    "PuckServer",
    "SensorLine",
    "SensorServer",
    "build_home_server",
    "hanging_load",
    "open_can_port",
]
