"""The container's frame from points that the sole has touched; pure."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from ft_sensor.payload import TerrainFrame
from wam.model.constants import Array

CORNERS = ("far left", "far right", "near left", "near right")
LARGEST_TILT = np.radians(1.0)  # between touched and expected incline
LEAST_EDGE = 0.05  # m between two touched corners of an edge
LEAST_LENGTH = 0.1  # m between the edges


@dataclass(frozen=True, slots=True)
class ContainerFit:
    """A container as touched.

    Attributes:
        frame: incline, heading, far end and length; `travel` is the whole distance
            from far to near edge.
        residual: rms distance of the points from the plane [m].
        roll: tilt of the plane about the way of the foot [rad]; 0 where it was
            levelled.
    """

    frame: TerrainFrame
    residual: float
    roll: float


def fit_terrain(points: NDArray[np.float64]) -> ContainerFit:
    """Return the container's frame from touched points.

    The plane is that of least squares through all points; the way of the foot leads
    from the middle of the far edge to that of the near edge.

    Args:
        points: of the sole [m], base frame, shape (n, 3), n >= 4; the first four are
            `CORNERS` in their order.

    Raises:
        SettingsError: too few points, corners too close together, or a vertical plane.
    """
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < len(CORNERS):
        raise SettingsError(
            f"{len(points)} points were touched, {len(CORNERS)} are needed.",
            hint=f"Touch, in this order: {', '.join(CORNERS)}.",
        )
    far, near = points[:2].mean(axis=0), points[2:4].mean(axis=0)
    _check_corners(points, far, near)
    centre = points.mean(axis=0)
    normal: Array = np.asarray(np.linalg.svd(points - centre)[2][2], np.float64)
    normal = normal if normal[2] > 0 else -normal
    if normal[2] < np.cos(np.radians(45.0)):
        raise SettingsError(
            "The touched plane is steeper than 45 degrees.",
            hint="Touch the corners again, the far edge first.",
        )
    along = near - far
    along -= normal * (along @ normal)
    length = float(np.linalg.norm(along))
    along /= length
    incline = float(np.arcsin(np.clip(-along[2], -1.0, 1.0)))
    heading = float(np.arctan2(-along[1], -along[0]))
    across = np.cross(normal, along)
    distances = (points - centre) @ normal
    far -= normal * float((far - centre) @ normal)
    x, y, z = (float(value) for value in far)
    return ContainerFit(
        frame=TerrainFrame(incline, heading, (x, y, z), length),
        residual=float(np.sqrt(distances @ distances / len(distances))),
        roll=float(np.arcsin(np.clip(across[2], -1.0, 1.0))),
    )


def check_terrain(
    fit: ContainerFit, expected: TerrainFrame, *, is_forced: bool
) -> None:
    """Hold a touched container against its row of the matrix.

    Raises:
        SettingsError: the incline is more than 1 degree off and it is not forced.
    """
    off = abs(fit.frame.incline - expected.incline)
    if off > LARGEST_TILT and not is_forced:
        raise SettingsError(
            f"The container is inclined by {np.degrees(fit.frame.incline):.1f} "
            f"degrees, the matrix says {np.degrees(expected.incline):.1f} (limit 1.0).",
            hint="Is it the right terrain? Level it, touch again, or add --force.",
        )


def _check_corners(points: NDArray[np.float64], far: Array, near: Array) -> None:
    edges = [float(np.linalg.norm(points[i + 1] - points[i])) for i in (0, 2)]
    if min(edges) < LEAST_EDGE or np.linalg.norm(near - far) < LEAST_LENGTH:
        raise SettingsError(
            f"The touched corners are too close: edges {edges[0]:.2f} and "
            f"{edges[1]:.2f} m wide, {np.linalg.norm(near - far):.2f} m apart.",
            hint=f"Touch, in this order: {', '.join(CORNERS)}.",
        )
