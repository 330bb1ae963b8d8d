"""What the figure of foresight shows, computed from held-out trials."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.series import Array
from analysis.foresight.calibration import BINS, equal_bins
from analysis.foresight.engine import EVERY, ForesightFlag
from analysis.foresight.signals import PERIOD
from analysis.foresight.ticks import (
    LONGEST_LEAD,
    ForesightRun,
    TrialTicks,
    leads_of,
    ticks_of,
)

SHOWN = 6.0  # s of a trial
TICK = EVERY * PERIOD  # s
_SLID = 200  # ticks of sliding over which the ground is recognised: 2 s
_FEW = 3  # trials from which on there is a mean
_LEADS = np.linspace(0.0, 1.0, 101)  # s


@dataclass(frozen=True, slots=True, eq=False)
class ForesightExcerpt:
    """A stretch of a held-out trial with many slips.

    Attributes:
        title: terrain and trial.
        t: time from its start [s], shape (n,).
        v_t: velocity that foresight saw [m/s], shape (n,).
        p: probability of a slip within 0.2 s, NaN = not known, shape (n,).
        threshold: of the alarms.
        onsets: of slips, from its start [s].
    """

    title: str
    t: Array
    v_t: Array
    p: Array
    threshold: float
    onsets: Array


@dataclass(frozen=True, slots=True, eq=False)
class ForesightCurves:
    """What held-out trials show of foresight.

    Attributes:
        excerpt: a stretch of one of them; None where nothing slipped.
        foreseen: mean probability of ten bins of equally many ticks at risk, (10,).
        seen: share of these ticks that a slip followed within 0.2 s, (10,).
        leads: times before an onset [s], shape (m,).
        warned: share of the slips with an alarm that long before, (m,).
        slid: time slid in a trial [s], shape (s,).
        grounds: mean probability of the true surface by terrain, each (s,), NaN where
            fewer than three trials slid so long.
    """

    excerpt: ForesightExcerpt | None
    foreseen: Array
    seen: Array
    leads: Array
    warned: Array
    slid: Array
    grounds: dict[str, Array]


def foresight_curves(runs: Sequence[ForesightRun]) -> ForesightCurves:
    """Return what trials show that the models have not seen."""
    seen_by = [(run, ticks) for run in runs if (ticks := ticks_of(run)).t.size]
    every = [ticks for _, ticks in seen_by]
    foreseen, seen = _reliability(every)
    leads = [lead for ticks in every for lead in leads_of(ticks)]
    warned = np.full(_LEADS.size, np.nan)
    if leads:
        ahead = np.array([-1.0 if lead is None else lead for lead in leads])
        warned = (ahead[:, None] >= _LEADS).mean(axis=0)
    return ForesightCurves(
        excerpt=_excerpt(seen_by),
        foreseen=foreseen,
        seen=seen,
        leads=_LEADS,
        warned=warned,
        slid=TICK * np.arange(1.0, _SLID + 1, dtype=np.float64),
        grounds=_grounds(runs),
    )


def _reliability(ticks: Sequence[TrialTicks]) -> tuple[Array, Array]:
    """Return mean probability and share of ten bins of equally many ticks."""
    p = np.concatenate([np.zeros(0), *(one.p[one.at_risk] for one in ticks)])
    truth = np.concatenate([np.zeros(0), *(one.before[one.at_risk] for one in ticks)])
    if p.size < BINS:
        return np.full(BINS, np.nan), np.full(BINS, np.nan)
    bins = equal_bins(p)
    foreseen = np.array([p[rows].mean() for rows in bins])
    return foreseen, np.array([truth[rows].mean() for rows in bins])


def _excerpt(
    seen_by: Sequence[tuple[ForesightRun, TrialTicks]],
) -> ForesightExcerpt | None:
    """Return the stretch that holds the most slips, the first of several."""
    best, most = None, 0
    for run, ticks in seen_by:
        for onset in ticks.onsets:
            start = onset - LONGEST_LEAD / 2
            inside = sum(start <= other <= start + SHOWN for other in ticks.onsets)
            if inside > most:
                best, most = (run, ticks, start), inside
    if best is None:
        return None
    run, ticks, start = best
    rows = (ticks.t >= start) & (ticks.t <= start + SHOWN)
    onsets = np.array([o for o in ticks.onsets if start <= o <= start + SHOWN])
    return ForesightExcerpt(
        title=f"{run.trial.terrain} {run.trial.name}",
        t=ticks.t[rows] - start,
        v_t=run.trial.motion[rows, 0],
        p=ticks.p[rows],
        threshold=run.threshold,
        onsets=onsets - start,
    )


def _grounds(runs: Sequence[ForesightRun]) -> dict[str, Array]:
    """Return the mean probability of the true surface over the time slid."""
    of_terrain: dict[str, list[Array]] = {}
    for run in runs:
        alike = [k for k, name in enumerate(run.surfaces) if name == run.trial.surface]
        if alike and len(alike) < len(run.surfaces):
            of_terrain.setdefault(run.trial.terrain, []).append(_own(run, alike))
    return {name: _means(np.array(rows)) for name, rows in of_terrain.items()}


def _own(run: ForesightRun, alike: Sequence[int]) -> Array:
    """Return the part that the true surface has of all known terrains, NaN-padded."""
    wanted = int(ForesightFlag.SLIDING)
    sliding = [state for state in run.states if state.flags & wanted][:_SLID]
    own = np.full(_SLID, np.nan)
    for k, state in enumerate(sliding):
        total = sum(state.terrains)
        if total > 0.0:
            own[k] = sum(state.terrains[n] for n in alike) / total
    return own


def _means(rows: Array) -> Array:
    """Return the mean over trials, shape (s,), NaN where there are too few."""
    count = np.isfinite(rows).sum(axis=0)
    total = np.nansum(rows, axis=0)
    return np.where(count >= _FEW, total / np.maximum(count, 1), np.nan)
