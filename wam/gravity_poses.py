"""Where a gravity calibration measures, and the way there, over safe ground."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wam.constants import ArmConstants, Array
from wam.first_moments import regressor
from wam.model import ArmModel
from wam.move import JointMove

OFFSET = 0.06  # rad; a pose is approached from this far on both sides
MARGIN = 0.2  # rad a pose stays away from the joint stops
FOLDED = (0.0, -1.2, 0.0, 2.2, 0.0, -0.6, 0.0)  # rad; the foot is high and near
_CANDIDATES = 600
_SEED = 7
_STEPS = 25  # of a path that is looked at
# How far from the folded pose a candidate may be [rad]: no wild contortions.
_REACH = np.array([0.9, 1.1, 1.0, 1.3, 1.2, 1.0, 1.0])


@dataclass(frozen=True, slots=True)
class Halt:
    """A place on the way.

    Attributes:
        q: joint positions [rad], shape (7,).
        pose: number of the pose measured here; None = on the way only.
    """

    q: Array
    pose: int | None


def choose_poses(model: ArmModel, count: int, floor: float) -> list[Array]:
    """Return `count` poses [rad], shapes (7,), that show gravity best.

    Out of many reachable ones whose sole is higher than `floor` [m], each next one is
    that which adds most to the information on the first moments (the determinant of
    Y^T Y grows most). The choice is always the same.
    """
    constants = model.constants
    reachable = _candidates(model, floor)
    blocks = [regressor(constants, q) for q in reachable]
    information = 1e-3 * np.eye(21)
    chosen: list[int] = []
    for _ in range(min(count, len(reachable))):
        inverse = np.linalg.inv(information)
        gains = [
            -np.inf
            if i in chosen
            else float(np.linalg.slogdet(np.eye(7) + Y @ inverse @ Y.T)[1])
            for i, Y in enumerate(blocks)
        ]
        best = int(np.argmax(gains))
        chosen.append(best)
        information += blocks[best].T @ blocks[best]
    return _in_short_order([reachable[i] for i in chosen])


def plan_halts(
    model: ArmModel, start: Array, poses: Sequence[Array], floor: float
) -> list[Halt]:
    """Return the halts: each pose from below and from above, in every joint.

    A straight way in joint space on which the sole would come lower than `floor` [m]
    goes by the folded pose; a pose that cannot be reached so either is left out.
    """
    folded = np.array(FOLDED)
    halts: list[Halt] = []
    here = start
    number = 0
    for pose in poses:
        if not is_clear(model, here, pose, floor):
            if not is_clear(model, folded, pose, floor):
                continue
            halts.append(Halt(folded, None))
        for side in (-OFFSET, OFFSET):
            halts += [Halt(pose + side, None), Halt(pose, number)]
        here = pose
        number += 1
    return [*halts, Halt(folded, None), Halt(start, None)]


def is_clear(model: ArmModel, start: Array, goal: Array, floor: float) -> bool:
    """Return whether the sole stays above `floor` [m] on the way; the start may not."""
    shares = np.linspace(0.0, 1.0, _STEPS)[2:, None]
    path = model.sole_path(start + shares * (goal - start))
    return bool((path.position[:, 2] > floor).all())


def way_seconds(start: Array, halts: Sequence[Halt]) -> float:
    """Return how long the moves take without the stops [s]."""
    total, here = 0.0, start
    for halt in halts:
        total += JointMove(here, halt.q).duration
        here = halt.q
    return total


def _candidates(model: ArmModel, floor: float) -> list[Array]:
    rng = np.random.default_rng(_SEED)
    folded = np.array(FOLDED)
    lower, upper = _bounds(model.constants)
    found: list[Array] = []
    for _ in range(_CANDIDATES):
        q = folded + _REACH * rng.uniform(-1.0, 1.0, 7)
        q = np.clip(q, lower, upper)
        if model.sole_pose(q)[0][2] > floor:
            found.append(q)
    return found


def _bounds(constants: ArmConstants) -> tuple[Array, Array]:
    away = MARGIN + OFFSET
    return constants.q_lower + away, constants.q_upper - away


def _in_short_order(poses: list[Array]) -> list[Array]:
    """Return the poses so that each next one is the nearest of those left."""
    left, here = list(poses), np.array(FOLDED)
    ordered: list[Array] = []
    while left:
        distances = [float(np.abs(q - here).max()) for q in left]
        here = left.pop(int(np.argmin(distances)))
        ordered.append(here)
    return ordered
