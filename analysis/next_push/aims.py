"""Pushes that a person can aim at, and what becomes of them.

Nine aims, three loads by three velocities. No operator meets an aim exactly: the error
is estimated from the operator's earlier trials that had one. The rows of a push are
those of the two trials nearest to it, moved to where it would come out.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.next_push.records import Aim, PushRecord

LOADS = ((3.0, "lightly"), (4.0, "as usual"), (5.5, "firmly"))  # N
SPEEDS = ((0.025, "slowly"), (0.04, "evenly"), (0.065, "fast"))  # m/s
AIMS = tuple(Aim(load, speed) for load, _ in LOADS for speed, _ in SPEEDS)
_SCATTER = np.array([0.25, 0.30])  # of log load and log velocity around an aim
_BELIEF, _CALM = 3.0, 2.0  # trials that these, and no bias, are worth
_TEMPLATES = 2  # trials whose rows stand for the next ones'
_SIGMA = (
    (-1.0, -1.0),
    (-1.0, 1.0),
    (1.0, -1.0),
    (1.0, 1.0),
)  # that scatter is taken at
_FURTHEST = 3.0  # logarithm that rows are moved by
_SLOWEST, _FASTEST = 0.005, 0.2  # window of the analysis [m/s]


class AimFollowing(NamedTuple):
    """How this operator meets aims.

    Attributes:
        bias: mean of log(achieved / aimed), load and velocity, shape (2,).
        scatter: standard deviation around it, shape (2,).
        trials: how many had an aim.
    """

    bias: Array
    scatter: Array
    trials: int


def following_of(records: Sequence[PushRecord]) -> AimFollowing:
    """Return how an operator meets aims, as far as the trials show it."""
    errors = np.array(
        [r.mean.log - r.aim.log for r in records if r.aim is not None]
    ).reshape(-1, 2)
    count = len(errors)
    bias = errors.sum(axis=0) / (count + _CALM)
    squares = ((errors - bias) ** 2).sum(axis=0)
    scatter = np.sqrt((_BELIEF * _SCATTER**2 + squares) / (_BELIEF + count))
    return AimFollowing(bias, scatter, count)


def expected_pushes(
    records: Sequence[PushRecord], aim: Aim, following: AimFollowing
) -> list[PushRecord]:
    """Return trials that may come of an aim, equally likely; their forces are void."""
    centre = aim.log + following.bias
    nearest = sorted(records, key=lambda r: _apart(r, centre))[:_TEMPLATES]
    pushes: list[PushRecord] = []
    for k, sigma in enumerate(_SIGMA):
        neighbour = nearest[k % len(nearest)]
        where = centre + following.scatter * np.array(sigma)
        load, speed = np.exp(np.clip(where - neighbour.mean.log, -_FURTHEST, _FURTHEST))
        pushes.append(
            replace(
                neighbour,
                F_n=neighbour.F_n * load,
                v_t=np.clip(neighbour.v_t * speed, _SLOWEST, _FASTEST),
                slips=neighbour.slips * load,
                aim=aim,
            )
        )
    return pushes


def _apart(record: PushRecord, centre: Array) -> float:
    """Return how far a trial came out from a place (log load, log velocity)."""
    far = record.mean.log - centre
    return float(far @ far)


def expected_by_aim(records: Sequence[PushRecord]) -> list[list[PushRecord]]:
    """Return the trials that may come of every aim, in the order of `AIMS`."""
    following = following_of(records)
    return [expected_pushes(records, aim, following) for aim in AIMS]
