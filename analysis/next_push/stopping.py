"""Whether further trials of a terrain would change the answer.

Enough is where two more trials, at the aim and the point of the target where they move
the answer most, would move it by less than single trials differ: two standard
deviations of the move against sqrt(sc^2 + 2 so^2 tau / T). One trial earlier it must
have been so, too: hyperparameters of a few trials wander. For break-away it is never
enough with less than a slip a trial. The matrix still decides how many there are to be.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import TractionError
from analysis.data.series import Array
from analysis.next_push.aims import expected_by_aim
from analysis.next_push.knowledge import Knowledge
from analysis.next_push.records import PushRecord

TARGETS = ("grid", "corner", "break-away")

_GRID = ((2.0, 4.0, 6.0, 8.0), (0.01, 0.03, 0.06, 0.12))  # F_n [N], v_t [m/s]
_CORNER = ((6.0, 8.0), (0.06, 0.12))  # firm and fast
_REFERENCE_LOAD, _LOADS = 3.5, (1.75, 7.0)  # N, of break-away; light and firm
_PEAK_SPREAD = 0.35  # of log peak at a load
_FEWEST = 7  # trials; fewer show the spread between them to no better than 30 %


class Stopping(NamedTuple):
    """Whether further trials would change the answer.

    For break-away, change and spread are shares of the force.

    Attributes:
        target: what is asked for.
        trials: how many there are.
        change: by how much two more would move the answer where they move it most,
            two standard deviations [N].
        spread: how much trials differ [N].
        is_enough: the change is smaller than the spread.
    """

    target: str
    trials: int
    change: float
    spread: float
    is_enough: bool

    @property
    def text(self) -> str:
        """Why it is enough or not, in one line."""
        share = self.target == "break-away"
        change, spread = (
            f"{value:.0%}" if share else f"{value:.1f} N"
            for value in (self.change, self.spread)
        )
        return (
            f"two more trials would move the {self.target} by {change}, trials differ "
            f"by {spread}"
        )


def points_of(target: str) -> Array:
    """Return the points (F_n [N], v_t [m/s]) of "grid" or "corner", shape (m, 2)."""
    loads, speeds = _CORNER if target == "corner" else _GRID
    return np.array([(F_n, v_t) for F_n in loads for v_t in speeds])


def slip_information(trials: Sequence[PushRecord]) -> Array:
    """Return sum over slips of [1 x; x x^2], x = log(F_n / 3.5 N), shape (2, 2).

    The information of slips about level and slope of the break-away force, over the
    square of its spread. Half a slip is added at either end of the usual loads, so
    that no slip at all has an information too.
    """
    loads = np.concatenate([np.array(_LOADS), *(r.slips for r in trials)])
    x = np.log(np.maximum(loads, 1.0) / _REFERENCE_LOAD)
    weight = np.ones(x.size)
    weight[:2] = 0.5
    return np.array([[weight.sum(), weight @ x], [weight @ x, weight @ x**2]])


def stopping_of(
    records: Sequence[PushRecord], kind: str, target: str
) -> Stopping | None:
    """Return whether two more trials would change the answer.

    None with fewer than seven.

    Args:
        records: of the kept trials, oldest first.
        kind: "flat" for a plate; anything else counts as stones.
        target: what is asked for, of `TARGETS`.
    """
    if len(records) < _FEWEST:
        return None
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # small matrices: more threads lose time
        try:
            return stopping_with(Knowledge.of(records, kind), target)
        except TractionError:
            return None


def stopping_with(knowledge: Knowledge, target: str) -> Stopping:
    """Return the same from what is known."""
    records = knowledge.records
    change, spread = _change(knowledge, target)
    is_enough = len(records) >= _FEWEST and change < spread
    if target == "break-away" and _slips_a_trial(records) < 1.0:
        is_enough = False  # a plate that slides: one further slip would tell most of it
    if is_enough:
        before = Knowledge.at(records[:-1], knowledge.theta)
        change_before, spread_before = _change(before, target)
        is_enough = change_before < spread_before
    return Stopping(target, len(records), change, spread, is_enough)


def _change(knowledge: Knowledge, target: str) -> tuple[float, float]:
    """Return how two more trials would move the answer, and how much trials differ."""
    records = knowledge.records
    if target == "break-away":
        return _slip_change(records)
    points = points_of(target)
    _, variance = knowledge.function(points)
    after = knowledge.variance_after(points, _pairs(records))
    moved = float(np.sqrt(np.maximum(variance - after, 0.0)).max())
    return 2.0 * moved, knowledge.level_spread


def _pairs(records: Sequence[PushRecord]) -> list[list[PushRecord]]:
    """Return two trials that may come of every aim, one below it and one above."""
    return [[pushes[0], pushes[-1]] for pushes in expected_by_aim(records)]


def _slip_change(records: Sequence[PushRecord]) -> tuple[float, float]:
    """Return how two more trials would move the break-away force, and its spread.

    Both as shares of the force, at a light or a firm load. Peaks scatter by 0.35 of
    themselves; a trial's mean peak therefore by that over the root of its slips.
    """
    now = np.linalg.inv(slip_information(records))
    further = [slip_information([*records, *pair]) for pair in _pairs(records)]
    x = np.log(np.array(_LOADS) / _REFERENCE_LOAD)
    ends = np.array([np.ones(2), x])
    lost = np.einsum("ie,kij,je->ke", ends, now - np.linalg.inv(further), ends)
    change = 2.0 * _PEAK_SPREAD * float(np.sqrt(max(lost.max(), 0.0)))
    return change, _PEAK_SPREAD / float(np.sqrt(max(_slips_a_trial(records), 1.0)))


def _slips_a_trial(records: Sequence[PushRecord]) -> float:
    return sum(r.slips.size for r in records) / len(records)
