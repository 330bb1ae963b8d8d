"""Excitation path of the friction calibration: each motor, both senses, two speeds."""

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

CENTRES = 3  # poses around which the joints oscillate, each with other gravity loads
_CANDIDATES = 12
# Joints that move together; signs differ so that both motors of a differential turn.
_COMBINED = (
    np.array([1.0, 1.0, -0.6, 1.0, 1.0, 0.5, 1.0]),
    np.array([1.0, -1.0, -0.6, 1.0, 1.0, -0.5, -1.0]),
)
_SINGLE = tuple(np.eye(7)[:4])
_WRIST = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 1.0])
# Amplitude [rad] and largest joint speed [rad/s].
_SLOW = ((0.012, 0.004), (0.03, 0.015), (0.07, 0.04), (0.12, 0.12))
_FAST = ((0.25, 0.4),)


class LegPurpose(Enum):
    """Purpose of a leg of the path."""

    TRANSIT = "transit"
    FIT = "fit"
    HELD_OUT = "held out"


@dataclass(frozen=True, slots=True)
class FrictionLeg:
    """One leg of the path.

    Attributes:
        waypoint: goal and speed.
        use: purpose of its recording.
    """

    waypoint: MeasurementPose
    use: LegPurpose


def plan_friction(model: ArmModel, start: Array, space: FreeSpace) -> list[FrictionLeg]:
    """Return the legs of a round trip from `start` [rad], shape (7,).

    Around each of three poses all joints oscillate slowly together, then fast one by
    one. The first pose is visited again at the end for the held-out path. No point of
    the arm is faster than in the other calibrations.

    Raises:
        SettingsError: too little space around the arm.
    """
    check_rise(model, start, space)
    centres = _centres(model, space)
    path: list[tuple[Array, float, LegPurpose]] = [
        (np.array(UPRIGHT), 0.5, LegPurpose.TRANSIT)
    ]
    for number, centre in enumerate(centres):
        path += _approach(model, path[-1][0], centre, space)
        path += _sweeps(centre, number)
    path += _approach(model, path[-1][0], centres[0], space)
    path += _held_out_path(centres[0])
    path += [
        (np.array(UPRIGHT), 0.5, LegPurpose.TRANSIT),
        (start, 0.5, LegPurpose.TRANSIT),
    ]
    legs: list[FrictionLeg] = []
    position, pose = start, -1
    for goal, speed, use in path:
        was_transit = not legs or legs[-1].use is LegPurpose.TRANSIT
        is_transit = use is LegPurpose.TRANSIT
        pose += was_transit and not is_transit
        top_speed = min(speed, leg_speed(model, position, goal))
        waypoint = MeasurementPose(goal, top_speed, None if is_transit else pose)
        legs.append(FrictionLeg(waypoint, use))
        position = goal
    return legs


def _approach(
    model: ArmModel, start: Array, centre: Array, space: FreeSpace
) -> list[tuple[Array, float, LegPurpose]]:
    """Return the path to `centre`: straight if clear, else by the upright pose."""
    upright = np.array(UPRIGHT)
    goals = [centre] if space.is_clear(model, start, centre) else [upright, centre]
    return [(goal, 0.5, LegPurpose.TRANSIT) for goal in goals]


def _sweeps(centre: Array, number: int) -> Iterator[tuple[Array, float, LegPurpose]]:
    """Yield (goal [rad], speed [rad/s], use) of the oscillations around pose `number`.

    The pattern alternates between poses: each motor of a differential is the faster one
    in one of them.
    """
    use, pattern = LegPurpose.FIT, _COMBINED[number % 2]
    for amplitude, speed in _SLOW:
        for side in (1.0, -1.0, 1.0):
            yield centre + side * amplitude * pattern, speed, use
    yield centre, 0.12, use
    for pattern in (*_SINGLE, _WRIST):
        for amplitude, speed in _FAST:
            for side in (1.0, -1.0):
                yield centre + side * amplitude * pattern, speed, use
        yield centre, 0.4, use


def _held_out_path(centre: Array) -> Iterator[tuple[Array, float, LegPurpose]]:
    """Yield the held-out path: other directions and speeds than those fitted."""
    pattern = np.array([0.7, 0.9, 0.7, -0.8, 1.0, 0.3, 1.0])
    for amplitude, speed in ((0.02, 0.01), (0.06, 0.06), (0.18, 0.25)):
        for side in (1.0, -1.0):
            yield centre + side * amplitude * pattern, speed, LegPurpose.HELD_OUT
    yield centre, 0.2, LegPurpose.HELD_OUT


def _centres(model: ArmModel, space: FreeSpace) -> list[Array]:
    """Return poses with clear space around them and most different motor loads.

    Raises:
        SettingsError: fewer than `CENTRES` poses have clear space.
    """
    candidates = [np.array(UPRIGHT), *choose_poses(model, _CANDIDATES, space)]
    usable = [centre for centre in candidates if _is_clear_around(model, centre, space)]
    if len(usable) < CENTRES:
        raise SettingsError(
            f"Only {len(usable)} of {len(candidates)} poses leave room to move back "
            f"and forth ({CENTRES} are needed).",
            hint="Calibrate with a lower container: --terrain NAME.",
        )
    to_motors = np.linalg.inv(model.constants.j2mp)
    loads = [np.abs(model.gravity(q) @ to_motors) for q in usable]
    return [usable[i] for i in _most_different_loads(loads)]


def _most_different_loads(loads: Sequence[Array]) -> list[int]:
    """Return the indices of the poses whose gravity torques at the motors differ most.

    Greedy: each next pose has the largest distance to the nearest one chosen.
    """
    scale = np.max(loads, axis=0) + 1e-9
    shares = [torques / scale for torques in loads]
    chosen = [0]
    while len(chosen) < CENTRES:
        distances = [
            min(float(np.abs(share - shares[j]).sum()) for j in chosen)
            for share in shares
        ]
        chosen.append(int(np.argmax(distances)))
    return chosen


def _is_clear_around(model: ArmModel, centre: Array, space: FreeSpace) -> bool:
    """Return whether all legs around `centre`, and its approach, are clear."""
    constants, upright = model.constants, np.array(UPRIGHT)
    legs = (*_sweeps(centre, 0), *_sweeps(centre, 1), *_held_out_path(centre))
    goals = [goal for goal, _, _ in legs]
    low, high = constants.q_lower + MARGIN, constants.q_upper - MARGIN
    if not all(((q >= low) & (q <= high)).all() for q in goals):
        return False
    if not space.is_clear(model, upright, centre):
        return False
    return all(space.is_clear(model, start, goal) for start, goal in pairwise(goals))
