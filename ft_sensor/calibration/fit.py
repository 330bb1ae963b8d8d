"""Payload and mounting of the sensor from readings in many orientations.

At rest and without contact the sensor reads

    f = s m R_WS^T g_w + b,   n = s c x (m R_WS^T g_w) + b_n

with R_WS = R_W7 Rz(psi). For a given mounting angle psi and sign s the forces are
linear in m and b, the torques in m c and b_n; psi is searched, both signs are tried.
Also the frame of a container from touched points.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from ft_sensor.payload import TerrainFrame, cross_matrix
from ft_sensor.weighing import LARGEST_TURN
from wam.model.constants import GRAVITY, Array

FEWEST = 6  # orientations
LARGEST_RESIDUAL = 0.3  # N rms; a sound sensor drifts by 0.2 between two poses
MIN_SPREAD = 0.15  # relative smallest singular value of the gravity directions
_LIGHTEST = 0.02  # kg; smallest mass that is significant
_COARSE = np.radians(np.arange(-180.0, 180.0, 5.0))
_FINE_STEPS = 40  # halvings of the bracket around the best coarse angle

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SensorFit:
    """Payload, bias and mounting fitted to a series of orientations.

    Attributes:
        mass: mass of everything below the gauges [kg].
        com: centre of mass in the sensor frame [m], shape (3,).
        bias: reading without load [N, N m], shape (6,).
        angle: angle of the sensor frame about z7 [rad], -pi..pi.
        sign: +1 if the sensor reads the load, -1 if it reads the reaction.
        residual: rms force residual [N].
        torque_residual: rms torque residual [N m].
    """

    mass: float
    com: Array
    bias: Array
    angle: float
    sign: float
    residual: float
    torque_residual: float


def fit_sensor(
    rotations: Floats,
    readings: Floats,
    mounting: tuple[float, float] | None = None,
) -> SensorFit:
    """Fit payload, bias and mounting to readings at torque_residual without contact.

    Args:
        rotations: orientations of frame 7 in the base frame, shape (n, 3, 3), n >= 6.
        readings: mean raw readings [N, N m], shape (n, 6).
        mounting: known angle [rad] and sign; None = fitted, too.

    Raises:
        SettingsError: too few or too similar orientations, or a wrong sign.
    """
    down = _directions(rotations)
    forces, torques = readings[:, :3], readings[:, 3:]
    fits: list[tuple[float, float, float, Array, float]] = []
    for sign in (1.0, -1.0) if mounting is None else (mounting[1],):
        acceleration = sign * GRAVITY * down
        angle = _search_angle(acceleration, forces) if mounting is None else mounting[0]
        fits.append((*_fit_forces(acceleration, forces, angle), sign))
    residual, angle, mass, bias, sign = min(fits, key=_cost)
    if mounting is not None and mass < -_LIGHTEST:
        raise SettingsError(
            f"The foot's weight has the opposite sign in the sensor: its sign is not "
            f"{sign:+.0f}.",
            hint=f"Write sign = {-sign:.0f} into [ft_sensor] of rig.toml, or run "
            "traction calibrate sensor.",
        )
    if mass <= 0.0:
        raise SettingsError(
            "The readings do not change with the orientation.",
            hint="Is this sensor the one that carries the foot, and does its sign in "
            "rig.toml fit?",
        )
    weight = mass * sign * GRAVITY * _in_sensor_frame(down, angle)
    moment, bias_torque, torque_residual = _fit_torques(weight / mass, torques)
    return SensorFit(
        mass=mass,
        com=moment / mass,
        bias=np.concatenate([bias, bias_torque]),
        angle=angle,
        sign=sign,
        residual=residual,
        torque_residual=torque_residual,
    )


def _cost(fit: tuple[float, float, float, Array, float]) -> float:
    residual, _, mass, _, _ = fit
    return residual if mass > 0.0 else np.inf


def turn_text(angle: float, other: float) -> str:
    """Return a text if a sensor is turned from `angle` to `other` [rad], else ""."""
    turned = float(np.degrees((other - angle + np.pi) % (2.0 * np.pi) - np.pi))
    if abs(turned) <= np.degrees(LARGEST_TURN):
        return ""
    return f"the sensor is turned by {turned:.0f} degrees about z"


def check_residual(
    fit: SensorFit, *, is_forced: bool, free: SensorFit | None = None
) -> None:
    """Refuse a fit with large force residuals.

    Args:
        fit: fit of the readings.
        is_forced: a person accepts it.
        free: fit of the same readings with free mounting; None = `fit` has it free.

    Raises:
        SettingsError: the residual exceeds 0.3 N and is not forced.
    """
    if fit.residual > LARGEST_RESIDUAL and not is_forced:
        turned = ""
        if free is not None and free.residual <= LARGEST_RESIDUAL:
            turned = turn_text(fit.angle, free.angle)
        if turned:
            raise SettingsError(
                f"The forces leave {fit.residual:.2f} N rms unexplained (limit "
                f"{LARGEST_RESIDUAL}), and {free.residual if free else 0.0:.2f} where "
                f"{turned}.",
                hint="Mount it as it was, or run traction calibrate sensor.",
            )
        raise SettingsError(
            f"The forces leave {fit.residual:.2f} N rms unexplained (limit "
            f"{LARGEST_RESIDUAL}).",
            hint="Did the foot touch something, or is the sensor still warming up "
            "(drift)? Start again, or add --force.",
        )


def _directions(rotations: Floats) -> Floats:
    """Return the directions of gravity in frame 7, shape (n, 3).

    Raises:
        SettingsError: too few or too similar orientations.
    """
    if len(rotations) < FEWEST:
        raise SettingsError(
            f"{len(rotations)} orientations were measured, {FEWEST} are needed.",
            hint="Use more poses.",
        )
    down = -rotations[:, 2, :]
    spread = np.linalg.svd(down - down.mean(axis=0), compute_uv=False)
    if spread[-1] < MIN_SPREAD * np.sqrt(len(down) / 3):
        raise SettingsError(
            "The orientations are too similar: the foot has to point up, down and to "
            "all sides.",
            hint="Use more different poses.",
        )
    return down


def _in_sensor_frame(down: Floats, angle: float) -> Floats:
    """Rotate directions from frame 7 to a sensor frame at `angle` about z7 [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return down @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _fit_forces(
    accelerations: Floats, forces: Floats, angle: float
) -> tuple[float, float, float, Array]:
    """Return (rms residual [N], angle, mass [kg], bias [N]) for one mounting angle."""
    in_sensor = _in_sensor_frame(accelerations, angle)
    centred = in_sensor - in_sensor.mean(axis=0)
    centred_forces = forces - forces.mean(axis=0)
    mass = float((centred * centred_forces).sum() / (centred * centred).sum())
    bias = forces.mean(axis=0) - mass * in_sensor.mean(axis=0)
    residuals = forces - mass * in_sensor - bias
    return float(np.sqrt((residuals**2).mean())), angle, mass, bias


def _search_angle(accelerations: Floats, forces: Floats) -> float:
    """Return the best mounting angle [rad], -pi..pi, with a positive mass."""

    def cost(angle: float) -> float:
        residual, _, mass, _ = _fit_forces(accelerations, forces, angle)
        return residual if mass > 0 else np.inf

    costs = [cost(float(angle)) for angle in _COARSE]
    middle = float(_COARSE[int(np.argmin(costs))])
    half = float(_COARSE[1] - _COARSE[0])
    for _ in range(_FINE_STEPS):
        half *= 0.7
        middle = min((middle - half, middle, middle + half), key=cost)
    return float((middle + np.pi) % (2 * np.pi) - np.pi)


def _fit_torques(accelerations: Floats, torques: Floats) -> tuple[Array, Array, float]:
    """Return (m c [kg m], bias [N m], rms residual [N m])."""
    rows = [np.hstack([-cross_matrix(a), np.eye(3)]) for a in accelerations]
    matrix = np.vstack(rows)
    solution: Array = np.asarray(
        np.linalg.lstsq(matrix, torques.ravel())[0], dtype=np.float64
    )
    residuals = torques.ravel() - matrix @ solution
    return solution[:3], solution[3:], float(np.sqrt((residuals**2).mean()))


CORNERS = ("far left", "far right", "near left", "near right")
LARGEST_TILT = np.radians(1.0)  # difference of measured and expected incline
LEAST_EDGE = 0.05  # m between the two corners of an edge
LEAST_LENGTH = 0.1  # m between the edges


@dataclass(frozen=True, slots=True)
class ContainerFit:
    """Frame of a container from touched points.

    Attributes:
        frame: incline, heading, far end and length; `travel` is the whole distance
            from far to near edge.
        residual: rms distance of the points from the plane [m].
        roll: tilt of the plane about the foot's path [rad]; 0 if levelled.
    """

    frame: TerrainFrame
    residual: float
    roll: float


def fit_terrain(points: NDArray[np.float64]) -> ContainerFit:
    """Fit the container's frame to touched points.

    The plane is fitted by least squares; the foot's path leads from the middle of the
    far edge to the middle of the near edge.

    Args:
        points: positions of the sole [m], base frame, shape (n, 3), n >= 4; the first
            four are `CORNERS` in their order.

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
    """Compare a measured container with its row of the matrix.

    Raises:
        SettingsError: the incline is more than 1 degree off and not forced.
    """
    if has_other_incline(fit, expected) and not is_forced:
        raise SettingsError(
            f"The container is inclined by {np.degrees(fit.frame.incline):.1f} "
            f"degrees, the matrix says {np.degrees(expected.incline):.1f} (limit 1.0).",
            hint="Is it the right terrain? Level it, touch again, or add --force.",
        )


def has_other_incline(fit: ContainerFit, expected: TerrainFrame) -> bool:
    """Return whether the measured incline differs from the terrain's row."""
    return abs(fit.frame.incline - expected.incline) > LARGEST_TILT


def _check_corners(points: NDArray[np.float64], far: Array, near: Array) -> None:
    edges = [float(np.linalg.norm(points[i + 1] - points[i])) for i in (0, 2)]
    if min(edges) < LEAST_EDGE or np.linalg.norm(near - far) < LEAST_LENGTH:
        raise SettingsError(
            f"The touched corners are too close: edges {edges[0]:.2f} and "
            f"{edges[1]:.2f} m wide, {np.linalg.norm(near - far):.2f} m apart.",
            hint=f"Touch, in this order: {', '.join(CORNERS)}.",
        )
