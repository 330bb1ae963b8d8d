# pyright: basic, reportMissingImports=false
"""Collision distances of the arm to itself, the floor and obstacles.

The links are enclosed by capsules and spheres, the obstacles are boxes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wam.model.arm_model import build_pinocchio
from wam.model.constants import ArmConstants, Array
from wam.model.tool import Tool

BASE_HEIGHT = 0.346  # height of the axis of joint 2 above the mounting surface [m]
CLEARANCE_MARGIN = 0.03  # m; least distance of a pair of bodies on a path
STEP = 0.02  # largest joint step between checked points of a path [rad]
_SLACK = 0.002  # m that a path may come closer than its ends, if these are close
_FLOOR = "the floor"
# Collision pairs by the names of `_bodies`, without neighbours, which always touch.
_REACHED_BY = {
    "the base": ("the elbow", "the forearm", "the wrist", "the foot"),
    "the shoulder": ("the forearm", "the wrist", "the foot"),
    "the upper arm": ("the wrist", "the foot"),
}
_MOVING = ("the upper arm", "the elbow", "the forearm", "the wrist", "the foot")


@dataclass(frozen=True, slots=True)
class ObstacleBox:
    """A fixed box.

    Attributes:
        name: name with its article, for messages.
        center: centre in the base frame [m], shape (3,).
        size: side lengths along its own axes [m], shape (3,).
        rotation: box to base, shape (3, 3).
    """

    name: str
    center: Array
    size: Array
    rotation: Array


@dataclass(frozen=True, slots=True)
class BodyGap:
    """Distance of two bodies [m]; negative if they overlap."""

    first: str
    second: str
    distance: float

    def text(self) -> str:
        """Return pair and distance as text."""
        return f"{self.first} {1e3 * self.distance:.0f} mm from {self.second}"


class ArmClearance:
    """Collision distances of one arm and its surroundings."""

    def __init__(
        self,
        constants: ArmConstants,
        tool: Tool,
        obstacles: Sequence[ObstacleBox] = (),
        floor: float = -BASE_HEIGHT,
    ) -> None:
        """Build the collision model.

        Args:
            constants: constants of the arm.
            tool: tool on its plate.
            obstacles: fixed boxes around the arm.
            floor: height of the mounting surface in the base frame [m].
        """
        self._model = build_pinocchio(constants)
        self._data = self._model.createData()
        self._shapes = pin.GeometryModel()
        indices = {
            name: self._add(name, *body) for name, body in _bodies(constants, tool)
        }
        slab = coal.Box(6.0, 6.0, 1.0)
        indices[_FLOOR] = self._add(
            _FLOOR, 0, slab, _translation(0.0, 0.0, floor - 0.5)
        )
        reached_by = {**_REACHED_BY, _FLOOR: _MOVING}
        for box in obstacles:
            placement = pin.SE3(box.rotation, box.center)
            indices[box.name] = self._add(box.name, 0, coal.Box(*box.size), placement)
            reached_by[box.name] = _MOVING
        for name, others in reached_by.items():
            for other in others:
                pair = pin.CollisionPair(indices[other], indices[name])
                self._shapes.addCollisionPair(pair)
        self._distances = pin.GeometryData(self._shapes)
        self._names = [
            (self._name(pair.first), self._name(pair.second))
            for pair in self._shapes.collisionPairs
        ]

    def distances(self, q: Array) -> Array:
        """Return the distance of every pair [m], shape (n,), at `q` [rad], (7,)."""
        pin.computeDistances(self._model, self._data, self._shapes, self._distances, q)
        results = self._distances.distanceResults
        return np.array([result.min_distance for result in results])

    def nearest(self, q: Array) -> BodyGap:
        """Return the closest pair at `q` [rad], shape (7,)."""
        return self._gap(self.distances(q))

    def first_collision(self, start: Array, goal: Array) -> BodyGap | None:
        """Return the first pair closer than the margin on the straight path, or None.

        A pair already closer at an end of the path, such as foot and container, is
        allowed if it comes no closer in between.

        Args:
            start: joint positions [rad], shape (7,).
            goal: joint positions [rad], shape (7,).
        """
        path = straight_path(start, goal)
        ends = np.minimum(self.distances(path[0]), self.distances(path[-1]))
        limits = np.minimum(CLEARANCE_MARGIN, ends - _SLACK)
        for q in path[1:-1]:
            distances = self.distances(q)
            if (distances < limits).any():
                return self._gap(distances - limits + CLEARANCE_MARGIN)
        return None

    def _gap(self, distances: Array) -> BodyGap:
        closest = int(distances.argmin())
        return BodyGap(*self._names[closest], float(distances[closest]))

    def _add(
        self, name: str, joint: int, shape: "coal.ShapeBase", placement: "pin.SE3"
    ) -> int:
        body = pin.GeometryObject(name, joint, placement, shape)
        return self._shapes.addGeometryObject(body)

    def _name(self, index: int) -> str:
        return self._shapes.geometryObjects[index].name


def straight_path(start: Array, goal: Array, step: float = STEP) -> NDArray[np.float64]:
    """Return joint positions on the straight path, shape (n, 7), n >= 2.

    No joint turns by more than `step` [rad] between two rows.
    """
    count = 2 + int(np.abs(goal - start).max() / step)
    return start + np.linspace(0.0, 1.0, count)[:, None] * (goal - start)


def _translation(x: float, y: float, z: float) -> "pin.SE3":
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def _bodies(
    constants: ArmConstants, tool: Tool
) -> list[tuple[str, tuple[int, "coal.ShapeBase", "pin.SE3"]]]:
    """Return (name, (joint, shape, placement in the joint's frame)) of every link.

    Upper arm, forearm and foot are capsules along the axes of joints 3, 5 and 7.
    """
    upper, fore = constants.d[2], constants.d[4]
    x, y, _ = tool.sole.tolist()
    end = float(constants.d[6] + tool.sole[2])
    return [
        ("the base", (0, *_capsule(0.12, -BASE_HEIGHT, -0.10))),
        ("the shoulder", (1, coal.Sphere(0.15), _translation(0.0, 0.0, 0.0))),
        ("the upper arm", (3, *_capsule(0.08, 0.08, upper))),
        ("the elbow", (4, coal.Sphere(0.09), _translation(0.0, 0.0, 0.0))),
        ("the forearm", (5, *_capsule(0.065, 0.0, fore))),
        ("the wrist", (6, coal.Sphere(0.065), _translation(0.0, 0.0, 0.0))),
        ("the foot", (7, *_capsule(0.045, 0.0, end, x, y))),
    ]


def _capsule(
    radius: float, low: float, high: float, x: float = 0.0, y: float = 0.0
) -> tuple["coal.Capsule", "pin.SE3"]:
    """Return a capsule along z from `low` to `high` [m], hemispheres included."""
    length = max(high - low - 2.0 * radius, 1e-3)
    return coal.Capsule(radius, length), _translation(x, y, 0.5 * (low + high))
