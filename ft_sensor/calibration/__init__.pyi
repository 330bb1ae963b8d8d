from .files import (
    payload_from_toml,
    payload_to_toml,
    terrain_from_toml,
    terrain_metadata,
    terrain_to_toml,
)
from .fit import (
    CORNERS,
    ContainerFit,
    SensorFit,
    check_residual,
    check_terrain,
    fit_sensor,
    fit_terrain,
)
from .sensor_file import SensorCalibration, sensor_from_toml, sensor_to_toml

__all__ = [
    "CORNERS",
    "ContainerFit",
    "SensorCalibration",
    "SensorFit",
    "check_residual",
    "check_terrain",
    "fit_sensor",
    "fit_terrain",
    "payload_from_toml",
    "payload_to_toml",
    "sensor_from_toml",
    "sensor_to_toml",
    "terrain_from_toml",
    "terrain_metadata",
    "terrain_to_toml",
]
