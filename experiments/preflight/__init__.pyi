from .conditions import (
    check_conditions,
    confirm_foot,
    last_foot,
    rig_conditions,
    sensor_conditions,
    write_conditions,
)
from .connecting import connect_rig
from .host_checks import free_bytes
from .preflight import Preflight, run_preflight, start_devices

__all__ = [
    "Preflight",
    "check_conditions",
    "confirm_foot",
    "connect_rig",
    "free_bytes",
    "last_foot",
    "rig_conditions",
    "run_preflight",
    "sensor_conditions",
    "start_devices",
    "write_conditions",
]
