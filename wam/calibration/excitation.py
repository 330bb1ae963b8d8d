"""The way of a calibration of friction: every motor both ways, slowly and fast."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np

from acquisition.errors import SettingsError
from wam.calibration.free_space import UPRIGHT, FreeSpace, check_rise
from wam.calibration.poses import (
    MARGIN,
    MeasurementPose,
    choose_poses,
    leg_speed,
)
from wam.model.arm_model import ArmModel
from wam.model.constants import Array

CENTRES = 3  # around which the joints go to and fro, with gravity from elsewhere
_CANDIDATES = 12
# Joints that go together; signs differ so that both motors of a differential turn.
_TOGETHER = (
    np.array([1.0, 1.0, -0.6, 1.0, 1.0, 0.5, 1.0]),
    np.array([1.0, -1.0, -0.6, 1.0, 1.0, -0.5, -1.0]),
)
_ALONE = tuple(np.eye(7)[:4])
_WRIST = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 1.0])
# Half of the way [rad] and largest joint speed [rad/s].
_SLOWLY = ((0.012, 0.004), (0.03, 0.015), (0.07, 0.04), (0.12, 0.12))
_FAST = ((0.25, 0.4),)


class LegUse(Enum):
    """What a leg of the way is for."""

    TRANSIT = "transit"
    FIT = "fit"
    HELD_OUT = "held out"


@dataclass(frozen=True, slots=True)
class FrictionLeg:
    """One leg of the way.

    Attributes:
        halt: where it goes and how fast.
        use: what is done with what is recorded on it.
    """

    halt: MeasurementPose
    use: LegUse


def plan_friction(model: ArmModel, start: Array, space: FreeSpace) -> list[FrictionLeg]:
    """Return the legs from `start` [rad], shape (7,), and back to it.

    Around each of three poses all joints go to and fro slowly and together, then one
    by one and fast. The first is visited again at the end, for a way that is not
    fitted. No point of the arm is faster than in the other calibrations.

    Raises:
        SettingsError: too little space around the arm.
    """
    check_rise(model, start, space)
    centres = _centres(model, space)
    way: list[tuple[Array, float, LegUse]] = [(np.array(UPRIGHT), 0.5, LegUse.TRANSIT)]
    for number, centre in enumerate(centres):
        way += _approach(model, way[-1][0], centre, space)
        way += _sweeps(centre, number)
    way += _approach(model, way[-1][0], centres[0], space)
    way += _check_way(centres[0])
    way += [(np.array(UPRIGHT), 0.5, LegUse.TRANSIT), (start, 0.5, LegUse.TRANSIT)]
    legs: list[FrictionLeg] = []
    here, pose = start, -1
    for goal, speed, use in way:
        was_transit = not legs or legs[-1].use is LegUse.TRANSIT
        is_transit = use is LegUse.TRANSIT
        pose += was_transit and not is_transit
        slower = min(speed, leg_speed(model, here, goal))
        halt = MeasurementPose(goal, slower, None if is_transit else pose)
        legs.append(FrictionLeg(halt, use))
        here = goal
    return legs


def _approach(
    model: ArmModel, here: Array, centre: Array, space: FreeSpace
) -> list[tuple[Array, float, LegUse]]:
    """Return the way to `centre`, by the upright pose where the straight one is not."""
    upright = np.array(UPRIGHT)
    goals = [centre] if space.is_clear(model, here, centre) else [upright, centre]
    return [(goal, 0.5, LegUse.TRANSIT) for goal in goals]


def _sweeps(centre: Array, number: int) -> Iterator[tuple[Array, float, LegUse]]:
    """Yield the ends of the ways around pose `number`, speeds [rad/s], and their use.

    Coupled motors change places from pose to pose: each is once the faster one.
    """
    use, pattern = LegUse.FIT, _TOGETHER[number % 2]
    for half, speed in _SLOWLY:
        for side in (1.0, -1.0, 1.0):
            yield centre + side * half * pattern, speed, use
    yield centre, 0.12, use
    for pattern in (*_ALONE, _WRIST):
        for half, speed in _FAST:
            for side in (1.0, -1.0):
                yield centre + side * half * pattern, speed, use
        yield centre, 0.4, use


def _check_way(centre: Array) -> Iterator[tuple[Array, float, LegUse]]:
    """Return other ways and speeds than those that are fitted."""
    pattern = np.array([0.7, 0.9, 0.7, -0.8, 1.0, 0.3, 1.0])
    for half, speed in ((0.02, 0.01), (0.06, 0.06), (0.18, 0.25)):
        for side in (1.0, -1.0):
            yield centre + side * half * pattern, speed, LegUse.HELD_OUT
    yield centre, 0.2, LegUse.HELD_OUT


def _centres(model: ArmModel, space: FreeSpace) -> list[Array]:
    """Return poses with room around them that load the motors most differently.

    Raises:
        SettingsError: there are not enough.
    """
    candidates = [np.array(UPRIGHT), *choose_poses(model, _CANDIDATES, space)]
    roomy = [centre for centre in candidates if _has_room(model, centre, space)]
    if len(roomy) < CENTRES:
        raise SettingsError(
            f"Only {len(roomy)} of {len(candidates)} poses leave room to move back and "
            f"forth ({CENTRES} are needed).",
            hint="Calibrate with a lower container: --terrain NAME.",
        )
    to_motors = np.linalg.inv(model.constants.j2mp)
    loads = [np.abs(model.gravity(q) @ to_motors) for q in roomy]
    return [roomy[i] for i in _most_different(loads)]


def _most_different(loads: Sequence[Array]) -> list[int]:
    """Return which poses differ most in the torques that the motors bear."""
    scale = np.max(loads, axis=0) + 1e-9
    shares = [torques / scale for torques in loads]
    chosen = [0]
    while len(chosen) < CENTRES:
        apart = [
            min(float(np.abs(share - shares[j]).sum()) for j in chosen)
            for share in shares
        ]
        chosen.append(int(np.argmax(apart)))
    return chosen


def _has_room(model: ArmModel, centre: Array, space: FreeSpace) -> bool:
    """Return whether the arm may go to and fro around `centre` and come there."""
    constants, upright = model.constants, np.array(UPRIGHT)
    ways = (*_sweeps(centre, 0), *_sweeps(centre, 1), *_check_way(centre))
    ends = [goal for goal, _, _ in ways]
    low, high = constants.q_lower + MARGIN, constants.q_upper - MARGIN
    if not all(((q >= low) & (q <= high)).all() for q in ends):
        return False
    if not space.is_clear(model, upright, centre):
        return False
    return all(space.is_clear(model, here, goal) for here, goal in pairwise(ends))
