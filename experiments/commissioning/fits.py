"""Fits of the recordings of C6 and C7: foot, sensor, base and joint zeros.

With s the sensor's sign, R its nominal orientation and w the foot's weight in the base
frame, the readings are s f = b + R^T w and s n = b_n + c x R^T w: linear in bias,
centre and weight. Differences with and without a known weight depend on that weight
only.
"""

from dataclasses import dataclass

import numpy as np

from experiments.commissioning.recording import Values, number
from ft_sensor.payload import cross_matrix
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

_PRIOR = np.radians(1.5)  # prior spread of each of the twelve angles
_DIRECTION, _STOP = np.radians(1.0), np.radians(0.6)  # measurement spreads
_STEP = 1e-6  # rad, step of numerical derivatives
_ROUNDS = 6
_DOWN = np.array([0.0, 0.0, -1.0])

FITTED = (  # names of the angles of `HungFit`
    *(f"the zero of joint {joint}" for joint in range(1, 8)),
    "the base about x",
    "the base about y",
    "the sensor about x",
    "the sensor about y",
    "the sensor about z",
)


@dataclass(frozen=True, slots=True)
class FootFit:
    """Fit of the foot's own weight.

    Attributes:
        mass: mass of the foot [kg].
        weight: weight in the base frame [N], shape (3,).
        centre: centre of mass in the sensor frame [m], shape (3,).
        tilt_deg: angle between its weight and the vertical.
        force_left: rms residual of a force axis [N].
        moment_left: rms residual of a moment axis [N m].
        lever: ratio of moment to force variations between poses [m].
    """

    mass: float
    weight: Array
    centre: Array
    tilt_deg: float
    force_left: float
    moment_left: float
    lever: float


@dataclass(frozen=True, slots=True)
class HungFit:
    """Fit of a known weight: sensor, sole and twelve angles.

    Attributes:
        scale: measured over known weight in each pose, shape (n,).
        sole: point of attack of the string in the sensor frame [m], shape (3,).
        tilt_deg: angle between the weight and the vertical, worst pose.
        angles: errors of the angles `FITTED` [rad], shape (12,).
        worst: index of the largest angle.
    """

    scale: Array
    sole: Array
    tilt_deg: float
    angles: Array
    worst: int


def fit_foot(values: Values) -> FootFit:
    """Fit mass, weight and centre of the foot to a recording of C6."""
    R = orientations(values, ArmModel(load_constants()))
    loads = number(values, "sign") * values["readings"]
    count = len(R)
    rows = np.zeros((3 * count, 6))
    rows[:, :3] = np.tile(np.eye(3), (count, 1))
    rows[:, 3:] = R.transpose(0, 2, 1).reshape(-1, 3)
    solution, *_ = np.linalg.lstsq(rows, loads[:, :3].ravel())
    w: Array = solution[3:].astype(np.float64)
    force_residuals = loads[:, :3].ravel() - rows @ solution
    arms = np.zeros((3 * count, 6))
    arms[:, :3] = np.tile(np.eye(3), (count, 1))
    arms[:, 3:] = np.concatenate([cross_matrix(rotation.T @ w).T for rotation in R])
    moment_solution, *_ = np.linalg.lstsq(arms, loads[:, 3:].ravel())
    moment_residuals = loads[:, 3:].ravel() - arms @ moment_solution
    return FootFit(
        mass=float(np.linalg.norm(w)) / GRAVITY,
        weight=w,
        centre=moment_solution[3:].astype(np.float64),
        tilt_deg=angle(w, _DOWN),
        force_left=_rms(force_residuals),
        moment_left=_rms(moment_residuals),
        lever=_lever(loads),
    )


def fit_hung(values: Values) -> HungFit:
    """Fit sensor, sole and angles to a recording of C7."""
    model = ArmModel(load_constants())
    R = orientations(values, model)
    unloaded = (values["before"] + values["after"]) / 2
    loads = number(values, "sign") * (values["loaded"] - unloaded)
    forces = loads[:, :3]
    tilts = [angle(turn @ force, _DOWN) for turn, force in zip(R, forces, strict=True)]
    arms = np.concatenate([cross_matrix(force).T for force in forces])
    sole, *_ = np.linalg.lstsq(arms, loads[:, 3:].ravel())
    angles = _fit_angles(values, forces, model)
    return HungFit(
        scale=np.linalg.norm(forces, axis=1) / (number(values, "hung") * GRAVITY),
        sole=sole.astype(np.float64),
        tilt_deg=max(tilts),
        angles=angles,
        worst=int(np.abs(angles).argmax()),
    )


def orientations(values: Values, model: ArmModel) -> Array:
    """Nominal orientations of the sensor in the base frame, shape (n, 3, 3)."""
    rotations = [model.plate_pose(q)[1] @ values["mounting"] for q in values["q"]]
    return np.array(rotations)


def _fit_angles(values: Values, forces: Array, model: ArmModel) -> Array:
    """Fit the errors of zeros, base and sensor [rad], shape (12,).

    Gauss-Newton with Gaussian priors on all angles.

    Args:
        values: recording of C7.
        forces: force of the hung weight in the sensor frame [N], shape (n, 3).
        model: model of the arm.
    """
    measured = forces / np.linalg.norm(forces, axis=1)[:, None]
    angles = np.zeros(len(FITTED))

    def residuals(x: Array) -> Array:
        predicted = np.array([_down(values, model, q, x) for q in values["q"]])
        parts = (
            ((predicted - measured) / _DIRECTION).ravel(),
            (x[:7] - values["stops"]) / _STOP,
            x / _PRIOR,
        )
        return np.concatenate(parts)

    steps = np.eye(len(angles)) * _STEP
    for _ in range(_ROUNDS):
        r = residuals(angles)
        jacobian = np.array(
            [(residuals(angles + step) - r) / _STEP for step in steps]
        ).T
        angles = angles - np.linalg.lstsq(jacobian, r)[0]
    return angles


def _down(values: Values, model: ArmModel, q: Array, x: Array) -> Array:
    """Direction of down in the sensor frame for angle errors `x`, shape (3,)."""
    # An encoder that reads x too much has its joint at q - x.
    arm = model.plate_pose(q - x[:7])[1]
    base = _turn(np.array([x[7], x[8], 0.0]))
    sensor = arm @ values["mounting"] @ _turn(x[9:12])
    return (base @ sensor).T @ _DOWN


def _turn(v: Array) -> Array:
    """Rotation by a vector of angles [rad], shape (3, 3) (Rodrigues)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    X = cross_matrix(v / angle)
    return np.eye(3) + np.sin(angle) * X + (1.0 - np.cos(angle)) * X @ X


def angle(a: Array, b: Array) -> float:
    """Angle between two vectors [degrees]."""
    share = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b) + 1e-12)
    return float(np.degrees(np.arccos(np.clip(share, -1.0, 1.0))))


def _lever(loads: Array) -> float:
    """Ratio of moment to force variations between poses [m]."""
    force, moment = loads[:, :3], loads[:, 3:]
    change = _rms(moment - moment.mean(axis=0)), _rms(force - force.mean(axis=0))
    return change[0] / max(change[1], 1e-9)


def _rms(left: Array) -> float:
    """Root mean square of residuals."""
    return float(np.sqrt((left**2).mean()))
