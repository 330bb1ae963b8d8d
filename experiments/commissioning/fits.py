"""What the recordings of C6 and C7 tell of foot, sensor, base and joint zeros.

With s the sensor's sign and R the believed orientation of the sensor, a foot that
weighs w in the base frame shows s f = b + R^T w and s n = b_n + c x R^T w: linear in
bias, centre and weight. Differences with and without a known weight are free of all but
that weight.
"""

from dataclasses import dataclass

import numpy as np

from experiments.commissioning.recording import Values, number
from ft_sensor.payload import cross_matrix
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array, load_constants

_PRIOR = np.radians(1.5)  # of each of the twelve angles
_DIRECTION, _STOP = np.radians(1.0), np.radians(0.6)  # spreads of what is measured
_STEP = 1e-6  # rad, of derivatives
_ROUNDS = 6
_DOWN = np.array([0.0, 0.0, -1.0])

FITTED = (  # what the angles of `HungFit` are of
    *(f"the zero of joint {joint}" for joint in range(1, 8)),
    "the base about x",
    "the base about y",
    "the sensor about x",
    "the sensor about y",
    "the sensor about z",
)


@dataclass(frozen=True, slots=True)
class FootFit:
    """The foot by its own weight.

    Attributes:
        mass: of it [kg].
        weight: of it in the base frame [N], shape (3,).
        centre: of it in the sensor frame [m], shape (3,).
        way: angle between its weight and down [degrees].
        force_left: what no weight explains, rms of an axis [N].
        moment_left: the same of moments [N m].
        lever: how many times larger than forces moments are, from pose to pose [m].
    """

    mass: float
    weight: Array
    centre: Array
    way: float
    force_left: float
    moment_left: float
    lever: float


@dataclass(frozen=True, slots=True)
class HungFit:
    """Sensor, sole and twelve angles by a known weight.

    Attributes:
        scale: measured weight over the known one in each pose, shape (n,).
        sole: where the string pulls in the sensor frame [m], shape (3,).
        way: angle between the weight and down, worst pose [degrees].
        angles: what `FITTED` are off by [rad], shape (12,).
        worst: index of the largest angle.
    """

    scale: Array
    sole: Array
    way: float
    angles: Array
    worst: int


def fit_foot(values: Values) -> FootFit:
    """Return the foot as the recording of C6 shows it."""
    R = orientations(values, ArmModel(load_constants()))
    loads = number(values, "sign") * values["readings"]
    count = len(R)
    rows = np.zeros((3 * count, 6))
    rows[:, :3] = np.tile(np.eye(3), (count, 1))
    rows[:, 3:] = R.transpose(0, 2, 1).reshape(-1, 3)
    solved, *_ = np.linalg.lstsq(rows, loads[:, :3].ravel())
    w: Array = solved[3:].astype(np.float64)
    left = loads[:, :3].ravel() - rows @ solved
    arms = np.zeros((3 * count, 6))
    arms[:, :3] = np.tile(np.eye(3), (count, 1))
    arms[:, 3:] = np.concatenate([cross_matrix(each.T @ w).T for each in R])
    centred, *_ = np.linalg.lstsq(arms, loads[:, 3:].ravel())
    twisted = loads[:, 3:].ravel() - arms @ centred
    return FootFit(
        mass=float(np.linalg.norm(w)) / GRAVITY,
        weight=w,
        centre=centred[3:].astype(np.float64),
        way=angle(w, _DOWN),
        force_left=_rms(left),
        moment_left=_rms(twisted),
        lever=_lever(loads),
    )


def fit_hung(values: Values) -> HungFit:
    """Return sensor, sole and angles as the recording of C7 shows them."""
    model = ArmModel(load_constants())
    R = orientations(values, model)
    both = (values["before"] + values["after"]) / 2
    loads = number(values, "sign") * (values["loaded"] - both)
    forces = loads[:, :3]
    ways = [angle(each @ force, _DOWN) for each, force in zip(R, forces, strict=True)]
    arms = np.concatenate([cross_matrix(force).T for force in forces])
    sole, *_ = np.linalg.lstsq(arms, loads[:, 3:].ravel())
    angles = _fit_angles(values, forces, model)
    return HungFit(
        scale=np.linalg.norm(forces, axis=1) / (number(values, "hung") * GRAVITY),
        sole=sole.astype(np.float64),
        way=max(ways),
        angles=angles,
        worst=int(np.abs(angles).argmax()),
    )


def orientations(values: Values, model: ArmModel) -> Array:
    """Return the believed orientations of the sensor in the base, (n, 3, 3)."""
    turned = [model.plate_pose(q)[1] @ values["mounting"] for q in values["q"]]
    return np.array(turned)


def _fit_angles(values: Values, forces: Array, model: ArmModel) -> Array:
    """Return what zeros, base and sensor are off by [rad], shape (12,).

    Args:
        values: of C7.
        forces: of the hung weight in the sensor's frame [N], shape (n, 3).
        model: of the arm.
    """
    seen = forces / np.linalg.norm(forces, axis=1)[:, None]
    angles = np.zeros(len(FITTED))

    def left(x: Array) -> Array:
        told = np.array([_down(values, model, q, x) for q in values["q"]])
        parts = (
            ((told - seen) / _DIRECTION).ravel(),
            (x[:7] - values["stops"]) / _STOP,
            x / _PRIOR,
        )
        return np.concatenate(parts)

    steps = np.eye(len(angles)) * _STEP
    for _ in range(_ROUNDS):
        here = left(angles)
        slopes = np.array([(left(angles + step) - here) / _STEP for step in steps]).T
        angles = angles - np.linalg.lstsq(slopes, here)[0]
    return angles


def _down(values: Values, model: ArmModel, q: Array, x: Array) -> Array:
    """Return where down is in the sensor's frame if `x` is off, shape (3,)."""
    # An encoder that tells too much by x has its joint at q - x.
    arm = model.plate_pose(q - x[:7])[1]
    base = _turn(np.array([x[7], x[8], 0.0]))
    sensor = arm @ values["mounting"] @ _turn(x[9:12])
    return (base @ sensor).T @ _DOWN


def _turn(v: Array) -> Array:
    """Return the rotation by a small vector of angles [rad], shape (3, 3)."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    X = cross_matrix(v / angle)
    return np.eye(3) + np.sin(angle) * X + (1.0 - np.cos(angle)) * X @ X


def angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors [degrees]."""
    share = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b) + 1e-12)
    return float(np.degrees(np.arccos(np.clip(share, -1.0, 1.0))))


def _lever(loads: Array) -> float:
    """Return how many times larger than forces moments are, from pose to pose [m]."""
    force, moment = loads[:, :3], loads[:, 3:]
    change = _rms(moment - moment.mean(axis=0)), _rms(force - force.mean(axis=0))
    return change[0] / max(change[1], 1e-9)


def _rms(left: Array) -> float:
    """Return the rms of what is left, axis by axis."""
    return float(np.sqrt((left**2).mean()))
