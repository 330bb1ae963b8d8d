"""Where a calibration measures, and the way there, over safe ground."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import SettingsError
from wam.control import TOP_SPEED, JointMove
from wam.model import ArmConstants, ArmModel, Array, regressor

OFFSET = 0.03  # rad; a pose is approached from this far on both sides
APPROACH_SPEED = 0.05  # rad/s, on the last bit
POINT_SPEED = 0.3  # m/s of sole and elbow; the safety module warns at 0.5
MARGIN = 0.2  # rad a pose stays away from the joint stops: no wall is near
UPRIGHT = (0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0)  # rad; elbow and foot are high
_CANDIDATES = 1000
_SEED = 7
_STEP = 0.04  # rad between two looks at a path
_SLACK = 0.002  # m a path may sag below its ends
# How far from the upright pose a candidate may be [rad]: no wild contortions. Gravity
# does not see joint 1, so the arm is not swung about.
REACH = np.array([0.0, 1.2, 1.1, 1.3, 1.3, 1.0, 1.0])


@dataclass(frozen=True, slots=True)
class MeasurementPose:
    """A place on the way.

    Attributes:
        q: joint positions [rad], shape (7,).
        speed: largest joint speed on the way to it [rad/s].
        pose: number of the pose measured here; None = on the way only.
    """

    q: Array
    speed: float
    pose: int | None


def choose_poses(model: ArmModel, count: int, floor: float) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), that show gravity best.

    Out of many in which sole, plate and elbow are higher than `floor` [m], each next
    one is that which adds most to the information on the first moments (the
    determinant of Y^T Y grows most). The choice is always the same.

    Raises:
        SettingsError: not as many poses are higher than `floor`.
    """
    reachable = _candidates(model, floor, count)
    blocks = [regressor(model.constants, q) for q in reachable]
    return _in_short_order([reachable[i] for i in _most_telling(blocks, count)])


def choose_orientations(model: ArmModel, count: int, floor: float) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), that turn the tool to all sides.

    As `choose_poses`, for a force sensor: each next pose adds most to the information
    on weight and offset, which are seen as m g d + b along three axes, d being the
    direction of gravity in frame 7.

    Raises:
        SettingsError: not as many poses are higher than `floor`.
    """
    reachable = _candidates(model, floor, count)
    down = [-model.plate_pose(q)[1][2] for q in reachable]
    blocks = [np.append(direction, 1.0)[None, :] for direction in down]
    return _in_short_order([reachable[i] for i in _most_telling(blocks, count)])


def _most_telling(blocks: Sequence[Array], count: int) -> list[int]:
    """Return which `count` of the regressors (k, p) tell most, one after the other."""
    rows, parameters = blocks[0].shape
    information = 1e-3 * np.eye(parameters)
    chosen: list[int] = []
    for _ in range(count):
        inverse = np.linalg.inv(information)
        gains = [
            -np.inf
            if i in chosen
            else float(np.linalg.slogdet(np.eye(rows) + Y @ inverse @ Y.T)[1])
            for i, Y in enumerate(blocks)
        ]
        best = int(np.argmax(gains))
        chosen.append(best)
        information += blocks[best].T @ blocks[best]
    return chosen


def plan_halts(
    model: ArmModel,
    start: Array,
    poses: Sequence[Array],
    floor: float,
    *,
    is_two_sided: bool = True,
) -> list[MeasurementPose]:
    """Return the halts: each pose from below and from above, in every joint.

    The way begins at `start` [rad], shape (7,), goes by the upright pose and ends at
    `start`. A straight way in joint space that would come lower than `floor` [m] goes
    by the upright pose; a pose that cannot be reached from there is left out. Where
    friction does not matter (`is_two_sided` false) each pose is reached once, directly.

    Raises:
        SettingsError: even the upright pose cannot be reached from `start`.
    """
    upright = np.array(UPRIGHT)
    if not is_clear(model, start, upright, floor):
        raise SettingsError(
            "The arm cannot rise from where it is without going down first.",
            hint="Lift the foot clear of everything and start again.",
        )
    way: list[tuple[Array, int | None]] = [(upright, None)]
    reachable = [pose for pose in poses if is_clear(model, upright, pose, floor)]
    for number, pose in enumerate(reachable):
        if not is_clear(model, way[-1][0], pose, floor):
            way.append((upright, None))
        if not is_two_sided:
            way.append((pose, number))
            continue
        for side in (-OFFSET, OFFSET):
            way += [(pose + side, None), (pose, number)]
    way += [(upright, None), (start, None)]
    before = [start, *(q for q, _ in way[:-1])]
    return [
        MeasurementPose(
            q,
            APPROACH_SPEED
            if pose is not None and is_two_sided
            else leg_speed(model, here, q),
            pose,
        )
        for here, (q, pose) in zip(before, way, strict=True)
    ]


def lowest(model: ArmModel, q: NDArray[np.float64]) -> Array:
    """Return the height of the lowest of sole, plate and elbow [m].

    Args:
        model: the arm with its tool.
        q: joint positions [rad], shape (n, 7).

    Returns:
        Heights in the base frame, shape (n,).
    """
    plate = np.array([model.plate_pose(row)[0][2] for row in q])
    sole = model.sole_path(q).position[:, 2]
    return np.minimum(np.minimum(plate, sole), _elbow(model.constants, q)[:, 2])


def is_clear(model: ArmModel, start: Array, goal: Array, floor: float) -> bool:
    """Return whether the arm stays above `floor` [m] on the straight way.

    An end that is lower itself, such as the foot in its container, may be left and
    reached, but nothing on the way is lower than the lower end.
    """
    heights = lowest(model, _path(start, goal))
    return bool(heights.min() >= min(floor, heights[0], heights[-1]) - _SLACK)


def leg_speed(model: ArmModel, start: Array, goal: Array) -> float:
    """Return the joint speed [rad/s] at which sole and elbow stay below 0.3 m/s."""
    path = _path(start, goal)
    points = (model.sole_path(path).position, _elbow(model.constants, path))
    steps = [np.linalg.norm(np.diff(p, axis=0), axis=1).max() for p in points]
    turned = float(np.abs(goal - start).max()) / (len(path) - 1)  # rad per step
    fastest = POINT_SPEED * turned / max(*steps, 1e-9)
    return float(min(TOP_SPEED, max(fastest, APPROACH_SPEED)))


def way_seconds(start: Array, halts: Sequence[MeasurementPose]) -> float:
    """Return how long the moves take without the stops [s]."""
    total, here = 0.0, start
    for halt in halts:
        total += JointMove(here, halt.q, halt.speed).duration
        here = halt.q
    return total


def _path(start: Array, goal: Array) -> NDArray[np.float64]:
    """Return joint positions on the straight way, shape (n, 7), n >= 2."""
    count = 2 + int(np.abs(goal - start).max() / _STEP)
    return start + np.linspace(0.0, 1.0, count)[:, None] * (goal - start)


def _elbow(constants: ArmConstants, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the elbow's axis [m], shape (n, 3), the link's width off its height."""
    reach, width = constants.d[2], abs(constants.a[2])
    out = reach * np.sin(q[:, 1])
    x, y = out * np.cos(q[:, 0]), out * np.sin(q[:, 0])
    return np.stack([x, y, reach * np.cos(q[:, 1]) - width], axis=-1)


def _candidates(model: ArmModel, floor: float, count: int) -> list[Array]:
    """Return poses that are above `floor` [m], also where they are approached.

    Raises:
        SettingsError: there are fewer than `count`.
    """
    rng = np.random.default_rng(_SEED)
    away = MARGIN + OFFSET
    constants = model.constants
    drawn = np.array(UPRIGHT) + REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7))
    drawn = np.clip(drawn, constants.q_lower + away, constants.q_upper - away)
    heights = np.min([lowest(model, drawn + d) for d in (-OFFSET, 0.0, OFFSET)], axis=0)
    reachable = list(drawn[heights > floor])
    if len(reachable) < count:
        raise SettingsError(
            f"Only {len(reachable)} of {_CANDIDATES} poses keep the arm above "
            f"{floor:.2f} m.",
            hint="Calibrate with a lower container: --terrain NAME.",
        )
    return reachable


def _in_short_order(poses: list[Array]) -> list[Array]:
    """Return the poses so that each next one is the nearest of those left."""
    left, here = list(poses), np.array(UPRIGHT)
    ordered: list[Array] = []
    while left:
        distances = [float(np.abs(q - here).max()) for q in left]
        here = left.pop(int(np.argmin(distances)))
        ordered.append(here)
    return ordered
