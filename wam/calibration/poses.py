"""Measurement poses of a calibration and a collision-free path through them."""

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
    elbow_position,
    lowest_height,
)
from wam.control.position_control import TOP_SPEED, JointMove
from wam.model.arm_model import ArmModel
from wam.model.clearance import straight_path
from wam.model.constants import Array
from wam.model.moments import regressor

APPROACH_SPEED = 0.05  # rad/s, for the last OFFSET before a pose
POINT_SPEED = 0.3  # m/s of sole and elbow; the safety module warns at 0.5
MARGIN = 0.2  # rad from a pose to the joint stops, clear of the soft walls
# Wrist turns from the upright pose (joint index, rad), the most informative first.
_TILTS = ((5, -1.2), (4, 1.0), (4, -1.0), (5, -0.6))
_CANDIDATES = 1000
_SEED = 7
# Largest deviation of a candidate from the upright pose [rad]. Joint 1 is vertical: its
# angle has no effect on gravity torques, so it stays at 0.
REACH = np.array([0.0, 1.2, 1.1, 1.3, 1.3, 1.0, 1.0])


@dataclass(frozen=True, slots=True)
class MeasurementPose:
    """A waypoint of the path.

    Attributes:
        q: joint positions [rad], shape (7,).
        speed: largest joint speed on the leg to it [rad/s].
        pose: index of the pose measured here; None = transit only.
    """

    q: Array
    speed: float
    pose: int | None


def choose_poses(model: ArmModel, count: int, space: FreeSpace) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), that are most informative on gravity.

    Greedy D-optimal design over random candidates within `space`: each next pose
    maximises the growth of det(Y^T Y) of the first moments' regressor. Deterministic.

    Raises:
        SettingsError: fewer than `count` candidates are within `space`.
    """
    reachable = _candidates(model, space, count)
    blocks = [regressor(model.constants, q) for q in reachable]
    return _nearest_neighbour_order(
        [reachable[i] for i in _most_informative(blocks, count)]
    )


def choose_orientations(model: ArmModel, count: int, space: FreeSpace) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), with diverse tool orientations.

    As `choose_poses`, for a force sensor: D-optimal for weight and offset in the
    reading m g d + b per axis, d being the direction of gravity in frame 7.

    Raises:
        SettingsError: fewer than `count` candidates are within `space`.
    """
    reachable = _candidates(model, space, count)
    down = [-model.plate_pose(q)[1][2] for q in reachable]
    blocks = [np.append(direction, 1.0)[None, :] for direction in down]
    return _nearest_neighbour_order(
        [reachable[i] for i in _most_informative(blocks, count)]
    )


def tilted_pair(model: ArmModel, space: FreeSpace) -> list[Array]:
    """Return two poses that differ by a turn of the wrist [rad], (7,) each.

    Gravity turns far about an axis perpendicular to z7 between them, which reveals a
    sensor mounted at a wrong angle about z7.

    Raises:
        SettingsError: no turn of the wrist is free of collision.
    """
    upright = np.array(UPRIGHT)
    for joint, angle in _TILTS:
        tilted = upright.copy()
        tilted[joint] += angle
        if space.is_free(tilted) and space.is_clear(model, upright, tilted):
            return [upright, tilted]
    raise SettingsError(
        "No wrist pose is free of collision.",
        hint="Is the terrain's frame in matrix.toml right? traction calibrate terrain",
    )


def _most_informative(blocks: Sequence[Array], count: int) -> list[int]:
    """Return the indices of `count` regressors (k, p) by greedy D-optimal selection."""
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


def plan_waypoints(
    model: ArmModel,
    start: Array,
    poses: Sequence[Array],
    space: FreeSpace,
    *,
    is_two_sided: bool = True,
) -> list[MeasurementPose]:
    """Return the waypoints that approach each pose from both sides, in every joint.

    The path begins at `start` [rad], shape (7,), goes by the upright pose and ends at
    `start`. A straight leg in joint space that would leave `space` goes by the upright
    pose; a pose that cannot be reached from there is left out. Where friction does not
    matter (`is_two_sided` false) each pose is reached once, directly.

    Raises:
        SettingsError: even the upright pose cannot be reached from `start`.
    """
    upright = np.array(UPRIGHT)
    check_rise(model, start, space)
    path: list[tuple[Array, int | None]] = [(upright, None)]
    reachable = [pose for pose in poses if space.is_clear(model, upright, pose)]
    for number, pose in enumerate(reachable):
        if not space.is_clear(model, path[-1][0], pose):
            path.append((upright, None))
        if not is_two_sided:
            path.append((pose, number))
            continue
        for side in (-OFFSET, OFFSET):
            path += [(pose + side, None), (pose, number)]
    path += [(upright, None), (start, None)]
    starts = [start, *(q for q, _ in path[:-1])]
    return [
        MeasurementPose(
            q,
            APPROACH_SPEED
            if pose is not None and is_two_sided
            else leg_speed(model, previous, q),
            pose,
        )
        for previous, (q, pose) in zip(starts, path, strict=True)
    ]


def leg_speed(model: ArmModel, start: Array, goal: Array) -> float:
    """Return the joint speed [rad/s] at which sole and elbow stay below 0.3 m/s."""
    path = straight_path(start, goal, STEP)
    points = (model.sole_path(path).position, elbow_position(model.constants, path))
    steps = [np.linalg.norm(np.diff(p, axis=0), axis=1).max() for p in points]
    turned = float(np.abs(goal - start).max()) / (len(path) - 1)  # rad per step
    fastest = POINT_SPEED * turned / max(*steps, 1e-9)
    return float(min(TOP_SPEED, max(fastest, APPROACH_SPEED)))


def travel_time(start: Array, halts: Sequence[MeasurementPose]) -> float:
    """Return the travel time without the stops [s]."""
    total, position = 0.0, start
    for halt in halts:
        total += JointMove(position, halt.q, halt.speed).duration
        position = halt.q
    return total


def _candidates(model: ArmModel, space: FreeSpace, count: int) -> list[Array]:
    """Return random poses within `space`, checked at both ends of their approach, too.

    Raises:
        SettingsError: there are fewer than `count`.
    """
    rng = np.random.default_rng(_SEED)
    margin = MARGIN + OFFSET
    constants = model.constants
    drawn = np.array(UPRIGHT) + REACH * rng.uniform(-1.0, 1.0, (_CANDIDATES, 7))
    drawn = np.clip(drawn, constants.q_lower + margin, constants.q_upper - margin)
    sides = (-OFFSET, 0.0, OFFSET)
    heights = np.min([lowest_height(model, drawn + side) for side in sides], axis=0)
    reachable = [
        q
        for q in drawn[heights > space.floor]
        if all(space.is_free(q + side) for side in sides)
    ]
    if len(reachable) < count:
        raise SettingsError(
            f"Only {len(reachable)} of {_CANDIDATES} poses keep the arm above "
            f"{space.floor:.2f} m and clear of everything.",
            hint="Calibrate with a lower container: --terrain NAME.",
        )
    return reachable


def _nearest_neighbour_order(poses: list[Array]) -> list[Array]:
    """Return the poses in nearest-neighbour order from the upright pose."""
    remaining, position = list(poses), np.array(UPRIGHT)
    ordered: list[Array] = []
    while remaining:
        distances = [float(np.abs(q - position).max()) for q in remaining]
        position = remaining.pop(int(np.argmin(distances)))
        ordered.append(position)
    return ordered
