"""Where a calibration measures, and the way there, over safe ground."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from wam.calibration.free_space import (
    OFFSET,
    STEP,
    UPRIGHT,
    FreeSpace,
    check_rise,
    elbow_of,
    lowest,
)
from wam.control.position_control import TOP_SPEED, JointMove
from wam.model.arm_model import ArmModel
from wam.model.clearance import straight_way
from wam.model.constants import Array
from wam.model.moments import regressor

APPROACH_SPEED = 0.05  # rad/s, on the last bit
POINT_SPEED = 0.3  # m/s of sole and elbow; the safety module warns at 0.5
MARGIN = 0.2  # rad a pose stays away from the joint stops: no wall is near
# Turns of the wrist from the upright pose (joint index, rad), the most telling first.
_TILTS = ((5, -1.2), (4, 1.0), (4, -1.0), (5, -0.6))
_CANDIDATES = 1000
_SEED = 7
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


def choose_poses(model: ArmModel, count: int, space: FreeSpace) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), that show gravity best.

    Out of many in which the arm keeps within `space`, each next one is that which adds
    most to the information on the first moments (the determinant of Y^T Y grows most).
    The choice is always the same.

    Raises:
        SettingsError: not as many poses are within `space`.
    """
    reachable = _candidates(model, space, count)
    blocks = [regressor(model.constants, q) for q in reachable]
    return _in_short_order([reachable[i] for i in _most_telling(blocks, count)])


def choose_orientations(model: ArmModel, count: int, space: FreeSpace) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), that turn the tool to all sides.

    As `choose_poses`, for a force sensor: each next pose adds most to the information
    on weight and offset, which are seen as m g d + b along three axes, d being the
    direction of gravity in frame 7.

    Raises:
        SettingsError: not as many poses are within `space`.
    """
    reachable = _candidates(model, space, count)
    down = [-model.plate_pose(q)[1][2] for q in reachable]
    blocks = [np.append(direction, 1.0)[None, :] for direction in down]
    return _in_short_order([reachable[i] for i in _most_telling(blocks, count)])


def tilted_pair(model: ArmModel, space: FreeSpace) -> list[Array]:
    """Return two poses that a short turn of the wrist leads between [rad], (7,) each.

    Between them gravity turns far about an axis across z7, so that a sensor that is
    turned about z7 shows it.

    Raises:
        SettingsError: no turn of the wrist is clear.
    """
    upright = np.array(UPRIGHT)
    for joint, angle in _TILTS:
        tilted = upright.copy()
        tilted[joint] += angle
        if space.holds(tilted) and space.is_clear(model, upright, tilted):
            return [upright, tilted]
    raise SettingsError(
        "No wrist pose is free of collision.",
        hint="Is the terrain's frame in matrix.toml right? traction calibrate terrain",
    )


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
    space: FreeSpace,
    *,
    is_two_sided: bool = True,
) -> list[MeasurementPose]:
    """Return the halts: each pose from below and from above, in every joint.

    The way begins at `start` [rad], shape (7,), goes by the upright pose and ends at
    `start`. A straight way in joint space that would leave `space` goes by the upright
    pose; a pose that cannot be reached from there is left out. Where friction does not
    matter (`is_two_sided` false) each pose is reached once, directly.

    Raises:
        SettingsError: even the upright pose cannot be reached from `start`.
    """
    upright = np.array(UPRIGHT)
    check_rise(model, start, space)
    way: list[tuple[Array, int | None]] = [(upright, None)]
    reachable = [pose for pose in poses if space.is_clear(model, upright, pose)]
    for number, pose in enumerate(reachable):
        if not space.is_clear(model, way[-1][0], pose):
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


def leg_speed(model: ArmModel, start: Array, goal: Array) -> float:
    """Return the joint speed [rad/s] at which sole and elbow stay below 0.3 m/s."""
    path = straight_way(start, goal, STEP)
    points = (model.sole_path(path).position, elbow_of(model.constants, path))
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


def _candidates(model: ArmModel, space: FreeSpace, count: int) -> list[Array]:
    """Return poses that are within `space`, also where they are approached.

    Raises:
        SettingsError: there are fewer than `count`.
    """
    rng = np.random.default_rng(_SEED)
    away = MARGIN + OFFSET
    constants = model.constants
    drawn = np.array(UPRIGHT) + REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7))
    drawn = np.clip(drawn, constants.q_lower + away, constants.q_upper - away)
    sides = (-OFFSET, 0.0, OFFSET)
    heights = np.min([lowest(model, drawn + side) for side in sides], axis=0)
    reachable = [
        q
        for q in drawn[heights > space.floor]
        if all(space.holds(q + side) for side in sides)
    ]
    if len(reachable) < count:
        raise SettingsError(
            f"Only {len(reachable)} of {_CANDIDATES} poses keep the arm above "
            f"{space.floor:.2f} m and clear of everything.",
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
