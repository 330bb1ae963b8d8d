"""Tool on the tool plate: sensor, foot, sole. Frame 7, z along joint 7."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wam.model.constants import Array, Body


@dataclass(frozen=True, slots=True)
class Tool:
    """Sensor and foot on the tool plate.

    Attributes:
        sensor: body of the wrist sensor.
        foot: body of foot and adapter, all below the sensor's gauges.
        sole: centre of the sole [m], shape (3,), in frame 7.
        sensor_height: height of the sensor frame above the plate along z7 [m].
        sensor_angle: rotation of the sensor frame about z7 [rad].
        sensor_sign: +1 if the sensor reads the load, -1 if it reads the reaction.
    """

    sensor: Body
    foot: Body
    sole: Array
    sensor_height: float = 0.012
    sensor_angle: float = 0.0
    sensor_sign: float = 1.0


def sensor_body() -> Body:
    """Return Barrett's wrist sensor: 0.136 kg, 12 mm high, 90 mm across."""
    return Body(0.136, np.array([0.0, 0.0, 0.006]), np.diag([7.0e-5, 7.0e-5, 1.377e-4]))


def box_inertia(mass: float, size: tuple[float, float, float]) -> Array:
    """Return the inertia of a box of `size` [m] about its centre, shape (3, 3)."""
    x, y, z = size
    return mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])


def tool_metadata(tool: Tool) -> dict[str, Any]:
    """Return `tool` as plain numbers and lists, for another process or a file."""
    return {
        "sensor": _body_metadata(tool.sensor),
        "foot": _body_metadata(tool.foot),
        "sole": tool.sole.tolist(),
        "sensor_height": tool.sensor_height,
        "sensor_angle": tool.sensor_angle,
        "sensor_sign": tool.sensor_sign,
    }


def tool_of(fields: Mapping[str, Any]) -> Tool:
    """Return the tool described by `tool_metadata`."""
    return Tool(
        sensor=_body_of(fields["sensor"]),
        foot=_body_of(fields["foot"]),
        sole=np.array(fields["sole"]),
        sensor_height=fields["sensor_height"],
        sensor_angle=fields["sensor_angle"],
        sensor_sign=fields["sensor_sign"],
    )


def _body_metadata(body: Body) -> dict[str, Any]:
    return {
        "mass": body.mass,
        "com": body.com.tolist(),
        "inertia": body.inertia.tolist(),
    }


def _body_of(fields: Mapping[str, Any]) -> Body:
    return Body(fields["mass"], np.array(fields["com"]), np.array(fields["inertia"]))
