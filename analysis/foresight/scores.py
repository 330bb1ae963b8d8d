"""What foresight is worth on trials that its models have not seen.

Three measures of needless warning always stand together: the share of at-risk time
outside the 0.2 s before slips (a controller), alarms a minute (an operator), and the
recall that the same alarms have when they are shifted in time (chance).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import NamedTuple

import numpy as np

from analysis.foresight.calibration import calibration_error
from analysis.foresight.ground import GroundModel, SurfaceRecogniser
from analysis.foresight.ticks import ForesightRun, TrialTicks, leads_of, ticks_of
from analysis.foresight.watching import (
    FLAT_SURFACE,
    HORIZON,
    ROCKY_SURFACE,
    WatchedTrial,
)

EARLY = 0.1  # s before an onset at which a warning still helps
SURE = 0.98
RIGHT = 0.95  # probability of the right surface after a change of ground
SHIFTS = 20  # of the alarms, equal parts of a trial
MOMENTS = (50, 100)  # sliding ticks after which a surface is asked: 0.5 and 1 s
_RUN = 10  # ticks of continuous sliding from which is counted
_BEFORE, _AFTER = 200, 300  # ticks of sliding around a change of ground


@dataclass(frozen=True, slots=True)
class SlipScore:
    """How slips were foreseen.

    Attributes:
        onsets: number of slips.
        recall: share with a warning in the 0.2 s before.
        lead: median from the beginning of the alarm to the onset [s], at most 2 s.
        early: share of all slips with an alarm 0.1 s before or more.
        needless: share of at-risk time outside the 0.2 s before slips in warning.
        per_minute: false alarms a minute.
        false_share: share of the alarms that were false.
        chance: recall of the same warnings shifted in time.
        calibration: mean difference of probability and share, ten bins of equal size.
        seconds: recorded.
    """

    onsets: int
    recall: float
    lead: float
    early: float
    needless: float
    per_minute: float
    false_share: float
    chance: float
    calibration: float
    seconds: float


@dataclass(frozen=True, slots=True)
class GroundScore:
    """How flat and rocky ground were told apart.

    Attributes:
        trials: number of trials that slid long enough.
        accuracy: after the `MOMENTS` of sliding, from the beginning of every trial.
        anywhere: the same of every second of sliding, what was before forgotten.
        sure_and_wrong: share of all answers of `anywhere` with 98 % or more, and wrong.
        calibration: of `anywhere`, ten bins, both surfaces weighing alike.
        back: median of the time to 95 % on the right surface after a change of ground
            [s of sliding]; infinite where it never came.
        slowest: the longest of them [s of sliding].
    """

    trials: int
    accuracy: tuple[float, ...]
    anywhere: tuple[float, ...]
    sure_and_wrong: float
    calibration: float
    back: float
    slowest: float


def score_slips(runs: Sequence[ForesightRun]) -> SlipScore:
    """Return how slips were foreseen in trials together."""
    ticks = [ticks_of(run) for run in runs]
    ticks = [one for one in ticks if one.t.size]
    leads = [lead for one in ticks for lead in leads_of(one)]
    onsets = sum(len(one.onsets) for one in ticks)
    calm = np.concatenate([one.warned[one.at_risk & ~one.before] for one in ticks])
    alarms, needless = _counted(ticks)
    seconds = float(sum(one.t[-1] - one.t[0] for one in ticks))
    hit = [lead for lead in leads if lead is not None]
    return SlipScore(
        onsets=onsets,
        recall=len(hit) / onsets if onsets else float("nan"),
        lead=float(np.median(hit)) if hit else float("nan"),
        early=sum(lead >= EARLY for lead in hit) / max(onsets, 1),
        needless=float(calm.mean()) if calm.size else float("nan"),
        per_minute=60.0 * needless / seconds if seconds else float("nan"),
        false_share=needless / alarms if alarms else 0.0,
        chance=_chance(ticks, onsets),
        calibration=calibration_error(
            np.concatenate([one.p[one.at_risk] for one in ticks]),
            np.concatenate([one.before[one.at_risk] for one in ticks]),
        ),
        seconds=seconds,
    )


def _counted(ticks: Sequence[TrialTicks]) -> tuple[int, int]:
    """Return (number of alarms, of those that no onset followed within 0.2 s)."""
    alarms = needless = 0
    for one in ticks:
        rows = np.searchsorted(one.t, [start for start, _ in one.alarms])
        for row, (start, end) in zip(rows, one.alarms, strict=True):
            if not one.at_risk[row]:
                continue  # late, the slip has begun
            alarms += 1
            needless += not any(start <= o <= end + HORIZON for o in one.onsets)
    return alarms, needless


def _chance(ticks: Sequence[TrialTicks], onsets: int) -> float:
    """Return the recall of the same warnings, moved round within their trial."""
    hits = 0
    for one in ticks:
        for part in range(1, SHIFTS):
            moved = np.roll(one.warned, part * one.t.size // SHIFTS)
            for onset in one.onsets:
                last = (one.t < onset) & (one.t >= onset - HORIZON) & one.at_risk
                hits += bool((moved & last).any())
    return hits / (onsets * (SHIFTS - 1)) if onsets else float("nan")


@dataclass(slots=True)
class GroundAnswers:
    """What a model says of the surface of trials that it has not seen.

    Attributes:
        trials: number of trials on flat or rocky ground.
        begun: whether the answer after each of `MOMENTS` was right, by trial.
        anew: (probability of rocky ground, whether it is), of every second of sliding.
        back: times to 95 % on the right surface after changes of ground [s].
    """

    trials: int = 0
    begun: list[list[bool]] = field(default_factory=lambda: [[] for _ in MOMENTS])
    anew: list[list[tuple[float, bool]]] = field(
        default_factory=lambda: [[] for _ in MOMENTS]
    )
    back: list[float] = field(default_factory=list[float])


def ground_answers(model: GroundModel, trials: Sequence[WatchedTrial]) -> GroundAnswers:
    """Return what a model says of trials; nothing where it has one surface only."""
    answers = GroundAnswers()
    if model.surfaces:
        known = [t for t in trials if t.surface in (FLAT_SURFACE, ROCKY_SURFACE)]
        answers.trials = len(known)
        for trial in known:
            _judge_trial(model, trial, answers)
        answers.back = _changes(model, known)
    return answers


def score_ground(answers: Sequence[GroundAnswers]) -> GroundScore | None:
    """Return how surfaces were told apart; None where no model has two of them.

    Args:
        answers: of models to trials that they have not seen.
    """
    count = sum(answer.trials for answer in answers)
    begun = [
        list(chain(*parts)) for parts in zip(*(a.begun for a in answers), strict=True)
    ]
    anew = [
        list(chain(*parts)) for parts in zip(*(a.anew for a in answers), strict=True)
    ]
    back = [time for answer in answers for time in answer.back]
    if not count or not all(anew):
        return None
    p, is_rocky = (np.array(column) for column in zip(*anew[0], strict=True))
    share = float(is_rocky.mean())
    weight = np.where(is_rocky, 0.5 / max(share, 1e-9), 0.5 / max(1.0 - share, 1e-9))
    return GroundScore(
        trials=count,
        accuracy=tuple(float(np.mean(right)) for right in begun),
        anywhere=tuple(float(np.mean([(p > 0.5) == r for p, r in a])) for a in anew),
        sure_and_wrong=float((np.where(is_rocky, 1.0 - p, p) >= SURE).mean()),
        calibration=calibration_error(p, is_rocky, weight),
        back=float(np.median(back)) if back else float("nan"),
        slowest=max(back, default=float("nan")),
    )


def _judge_trial(
    model: GroundModel, trial: WatchedTrial, answers: GroundAnswers
) -> None:
    """Add the answers of a trial, from its beginning and begun anew every second."""
    is_rocky, slid = trial.surface == ROCKY_SURFACE, _slid(trial)
    first = _first_run([tick.tick for tick in slid])
    recogniser = SurfaceRecogniser(model.surfaces)
    asked = {first + moment: k for k, moment in enumerate(MOMENTS)}
    for count, tick in enumerate(slid[: first + MOMENTS[-1]], 1):
        recogniser.push(*tick)
        if count in asked and recogniser.rocky is not None:
            right = (recogniser.rocky > 0.5) == is_rocky
            answers.begun[asked[count]].append(right)
    for start in range(0, len(slid) - MOMENTS[-1], MOMENTS[-1]):
        recogniser = SurfaceRecogniser(model.surfaces, slid=start)
        for count, tick in enumerate(slid[start : start + MOMENTS[-1]], 1):
            recogniser.push(*tick)
            if count in MOMENTS and recogniser.rocky is not None:
                moment = MOMENTS.index(count)
                answers.anew[moment].append((recogniser.rocky, is_rocky))


class _SlidTick(NamedTuple):
    """A tick of sliding, as `GroundRecogniser.push` takes it."""

    tick: int
    v: float
    F_t: float
    F_n: float


def _slid(trial: WatchedTrial) -> list[_SlidTick]:
    """Return the ticks in which the foot slides."""
    rows = trial.sliding
    pairs = zip(trial.tick[rows].tolist(), trial.motion[rows].tolist(), strict=True)
    return [_SlidTick(tick, *motion) for tick, motion in pairs]


def _first_run(ticks: Sequence[int]) -> int:
    """Return how many sliding ticks lie before the first continuous 0.1 s."""
    for k in range(len(ticks) - _RUN + 1):
        if ticks[k + _RUN - 1] - ticks[k] == _RUN - 1:
            return k
    return len(ticks)


def _changes(model: GroundModel, trials: Sequence[WatchedTrial]) -> list[float]:
    """Return the times to 95 % on the right surface after changes of ground [s]."""
    flat = [t for t in trials if t.surface == FLAT_SURFACE]
    rocky = [t for t in trials if t.surface == ROCKY_SURFACE]
    if not flat or not rocky:
        return []
    times: list[float] = []
    slid = [_slid(trial) for trial in trials]
    for k, before in enumerate(trials):
        others = rocky if before.surface == FLAT_SURFACE else flat
        after = others[k % len(others)]
        following = slid[trials.index(after)]
        if len(slid[k]) >= _BEFORE and len(following) >= _BEFORE + MOMENTS[-1]:
            ends = slid[k][:_BEFORE], following[_BEFORE : _BEFORE + _AFTER]
            times.append(_time_back(model, *ends, after.surface))
    return times


def _time_back(
    model: GroundModel,
    before: Sequence[_SlidTick],
    after: Sequence[_SlidTick],
    surface: str,
) -> float:
    """Return the time to 95 % on the surface that a foot slides onto [s]."""
    recogniser = SurfaceRecogniser(model.surfaces)
    for tick in before:
        recogniser.push(*tick)
    offset = before[-1].tick + 1 - after[0].tick
    for count, tick in enumerate(after, 1):
        recogniser.push(tick.tick + offset, *tick[1:])
        rocky = recogniser.rocky
        if rocky is None:
            continue
        right = rocky if surface == ROCKY_SURFACE else 1.0 - rocky
        if right >= RIGHT:
            return count * 0.01
    return float("inf")
