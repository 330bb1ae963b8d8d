"""Obstacles of an arm that moves automatically: floor and container."""

import numpy as np

from experiments.rig.build import build_tool, terrain_frame
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from ft_sensor.payload import TerrainFrame
from wam.calibration.free_space import FreeSpace
from wam.model.clearance import BASE_HEIGHT, ArmClearance, ObstacleBox
from wam.model.constants import load_constants

ABOVE = 0.10  # m, clearance of sole, plate and elbow above the highest container
RIM = 0.03  # height of a container's rim above its plane [m]
_BESIDE, _BEYOND = 0.25, 0.10  # half a container's width, and past a trial's ends [m]


def container_box(frame: TerrainFrame) -> ObstacleBox:
    """Return the container as a box on the floor."""
    axes = frame.axes()
    depth = _highest(frame) + BASE_HEIGHT
    size = np.array([frame.travel + 2.0 * _BEYOND, 2.0 * _BESIDE, depth + RIM])
    middle = np.array([0.5 * frame.travel, 0.0, 0.5 * (RIM - depth)])
    center = np.array(frame.start) + middle @ axes
    return ObstacleBox("the container", center, size, axes.T)


def free_space(settings: Settings, row: TerrainRow) -> FreeSpace:
    """Return the free space of the arm with the foot and container of `row`."""
    frames = map(terrain_frame, settings.matrix.terrains)
    floor = max(map(_highest, frames)) + ABOVE
    tool = build_tool(settings.rig, row.foot)
    box = container_box(terrain_frame(row))
    return FreeSpace(floor, ArmClearance(load_constants(), tool, (box,)))


def _highest(frame: TerrainFrame) -> float:
    """Height of the higher end of a container [m]."""
    return max(frame.start[2], frame.from_other_end().start[2])
