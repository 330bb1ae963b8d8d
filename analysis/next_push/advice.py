"""The next push: of those that a person can aim at, the one that teaches most.

The gain of an aim is its mean over the scatter with which this operator follows aims.
Slips cross the whole plane in every trial, so aims differ less than one would hope.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import TractionError
from analysis.data.series import Array
from analysis.next_push.aims import AIMS, LOADS, SPEEDS, expected_by_aim
from analysis.next_push.knowledge import Knowledge
from analysis.next_push.records import Aim, PushRecord
from analysis.next_push.stopping import (
    Stopping,
    points_of,
    slip_information,
    stopping_with,
)

_WORDS = {
    Aim(load, speed): f"{pressed} ({load:g} N), {pushed} ({speed:g} m/s)"
    for load, pressed in LOADS
    for speed, pushed in SPEEDS
}


@dataclass(frozen=True, slots=True)
class Advice:
    """What to do next.

    Attributes:
        aim: of the push that teaches most.
        reason: why, in words.
        gains: expected gain of every aim [nats], in the order of `AIMS`.
        stopping: whether further trials would change the answer; None with too few.
    """

    aim: Aim
    reason: str
    gains: tuple[float, ...]
    stopping: Stopping | None

    @property
    def text(self) -> str:
        """The aim and its reason in one line."""
        return f"{_WORDS[self.aim]}: {self.reason}"


def advise(records: Sequence[PushRecord], kind: str, target: str) -> Advice | None:
    """Return the push that teaches most about a target; None without a record.

    Args:
        records: of the kept trials, oldest first.
        kind: "flat" for a plate; anything else counts as stones.
        target: "grid", "corner" (firm and fast) or "break-away".
    """
    if not records:
        return None
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # the cores are the arm's, and more threads lose time
        return _advise(records, kind, target)


def _advise(records: Sequence[PushRecord], kind: str, target: str) -> Advice | None:
    pushes = expected_by_aim(records)
    try:
        knowledge = Knowledge.of(records, kind)
    except TractionError:
        return None
    if target == "break-away":
        gains = _slip_gains(knowledge.records, pushes)
        best = int(np.argmax(gains))
        reason = _slip_reason(knowledge.records, pushes[best])
    else:
        gains, reasons = _function_gains(knowledge, pushes, points_of(target))
        best = int(np.argmax(gains))
        reason = reasons[best]
    return Advice(
        AIMS[best], reason, tuple(gains.tolist()), stopping_with(knowledge, target)
    )


def _function_gains(
    knowledge: Knowledge, pushes: Sequence[Sequence[PushRecord]], points: Array
) -> tuple[Array, list[str]]:
    """Return the expected gain of every aim, and the reason for each."""
    _, variance = knowledge.function(points)
    single = [[push] for aim in pushes for push in aim]
    after = knowledge.variance_after(points, single)
    after = after.reshape(len(pushes), -1, len(points))
    gains = 0.5 * np.log(variance / after).sum(axis=2).mean(axis=1)
    reasons: list[str] = []
    for each in after.mean(axis=1):
        k = int(np.argmax(variance - each))
        F_n, v_t = points[k]
        now, then = 2.0 * np.sqrt(variance[k]), 2.0 * np.sqrt(each[k])
        condition = f"{F_n:g} N, {v_t:g} m/s"
        reasons.append(f"F_t at {condition} from ± {now:.1f} to ± {then:.1f} N")
    return gains, reasons


def _slip_gains(
    records: Sequence[PushRecord], pushes: Sequence[Sequence[PushRecord]]
) -> Array:
    """Return the expected gain about the break-away force of every aim."""
    now = np.linalg.slogdet(slip_information(records))[1]
    after = [
        [np.linalg.slogdet(slip_information([*records, push]))[1] for push in aim]
        for aim in pushes
    ]
    return 0.5 * (np.array(after).mean(axis=1) - now)


def _slip_reason(records: Sequence[PushRecord], pushes: Sequence[PushRecord]) -> str:
    loads = np.concatenate([push.slips for push in pushes] or [np.zeros(0)])
    every = np.concatenate([r.slips for r in records])
    if not loads.size:
        return f"{every.size} slips so far"
    low, high = np.percentile(loads, [10.0, 90.0])
    inside = int(np.count_nonzero((every >= low) & (every <= high)))
    return f"{inside} of {every.size} slips so far were at {low:.1f} to {high:.1f} N"
