"""Space for automatic motion: above a floor, without collisions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from wam.model.arm_model import ArmModel
from wam.model.clearance import CLEARANCE_MARGIN, ArmClearance, straight_path
from wam.model.constants import ArmConstants, Array

OFFSET = 0.03  # rad; a pose is approached from this far on both sides
UPRIGHT = (0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0)  # rad; elbow and foot are high
STEP = 0.04  # rad between two checked points of a path
_SLACK = 0.002  # m that a path may sag below its ends


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """Space in which the arm may move by itself.

    Attributes:
        floor: lowest height of sole, plate and elbow [m].
        clearance: collision distances to itself and its surroundings; None = check
            `floor` only.
    """

    floor: float
    clearance: ArmClearance | None = None

    def is_free(self, q: Array) -> bool:
        """Return whether the pose `q` [rad], shape (7,), is free of collision."""
        return (
            self.clearance is None
            or self.clearance.nearest(q).distance > CLEARANCE_MARGIN
        )

    def is_clear(self, model: ArmModel, start: Array, goal: Array) -> bool:
        """Return whether the straight path `start` to `goal` [rad], (7,), is clear."""
        if not is_clear(model, start, goal, self.floor):
            return False
        return (
            self.clearance is None
            or self.clearance.first_collision(start, goal) is None
        )


def check_poses(model: ArmModel, poses: Sequence[Array], space: FreeSpace) -> None:
    """Refuse unsafe poses of a person's choice before the arm moves.

    Args:
        model: the arm with its tool.
        poses: joint positions [rad], shape (7,) each.
        space: space in which the arm may move.

    Raises:
        SettingsError: a pose, its approach or the path from the upright pose is beyond
            a joint stop or in collision.
    """
    constants = model.constants
    low, high = constants.q_lower + OFFSET, constants.q_upper - OFFSET
    for number, pose in enumerate(poses, 1):
        if not ((pose >= low) & (pose <= high)).all():
            joint = int(np.maximum(low - pose, pose - high).argmax()) + 1
            raise _pose_error(number, f"joint {joint} is beyond its stop")
        if space.clearance is not None:
            _check_gaps(number, pose, space.clearance)
        if not is_clear(model, np.array(UPRIGHT), pose, space.floor):
            raise _pose_error(number, f"the arm would come below {space.floor:.2f} m")


def _check_gaps(number: int, pose: Array, clearance: ArmClearance) -> None:
    """Refuse a pose in collision, or whose path from the upright pose is."""
    gaps = [clearance.nearest(pose + side) for side in (-OFFSET, 0.0, OFFSET)]
    closest = min(gaps, key=lambda gap: gap.distance)
    if closest.distance <= CLEARANCE_MARGIN:
        raise _pose_error(number, closest.text())
    hit = clearance.first_collision(np.array(UPRIGHT), pose)
    if hit is not None:
        raise _pose_error(number, f"on the way to it {hit.text()}")


def _pose_error(number: int, why: str) -> SettingsError:
    return SettingsError(
        f"Pose {number} cannot be used: {why}.",
        hint=f"Bodies stay {1e3 * CLEARANCE_MARGIN:.0f} mm apart. Change this pose or "
        "leave it out. Nothing was started.",
    )


def check_rise(model: ArmModel, start: Array, space: FreeSpace) -> None:
    """Refuse a start whose path to the upright pose is not clear.

    Raises:
        SettingsError: the path goes down first or collides.
    """
    upright = np.array(UPRIGHT)
    hint = "Lift the foot clear of everything and start again."
    if not is_clear(model, start, upright, space.floor):
        raise SettingsError(
            "The arm cannot rise from where it is without going down first.", hint=hint
        )
    hit = space.clearance.first_collision(start, upright) if space.clearance else None
    if hit is not None:
        raise SettingsError(
            f"The arm cannot rise from where it is: on the way {hit.text()} "
            f"(limit {1e3 * CLEARANCE_MARGIN:.0f} mm).",
            hint=hint,
        )


def lowest_height(model: ArmModel, q: NDArray[np.float64]) -> Array:
    """Return the height of the lowest of sole, plate and elbow [m].

    Args:
        model: the arm with its tool.
        q: joint positions [rad], shape (n, 7).

    Returns:
        Heights in the base frame, shape (n,).
    """
    plate = np.array([model.plate_pose(row)[0][2] for row in q])
    sole = model.sole_path(q).position[:, 2]
    return np.minimum(np.minimum(plate, sole), elbow_position(model.constants, q)[:, 2])


def is_clear(model: ArmModel, start: Array, goal: Array, floor: float) -> bool:
    """Return whether the arm stays above `floor` [m] on the straight path.

    An end below `floor`, such as the foot in its container, is allowed if no point of
    the path is lower than the lower end.
    """
    heights = lowest_height(model, straight_path(start, goal, STEP))
    return bool(heights.min() >= min(floor, heights[0], heights[-1]) - _SLACK)


def elbow_position(
    constants: ArmConstants, q: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the elbow axis lowered by the link's width [m], shape (n, 3)."""
    reach, width = constants.d[2], abs(constants.a[2])
    radius = reach * np.sin(q[:, 1])
    x, y = radius * np.cos(q[:, 0]), radius * np.sin(q[:, 0])
    return np.stack([x, y, reach * np.cos(q[:, 1]) - width], axis=-1)
