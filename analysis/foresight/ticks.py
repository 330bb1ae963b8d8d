"""Foresight and truth of one trial, tick by tick: what scores and figures count."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.foresight.engine import EVERY, ForesightFlag, ForesightState
from analysis.foresight.watching import HORIZON, WatchedTrial

LONGEST_LEAD = 2.0  # s; an alarm that never ends has no lead


@dataclass(frozen=True, slots=True)
class ForesightRun:
    """A trial, and what was foreseen in it.

    Attributes:
        trial: as it was watched.
        states: every 10 ms.
        threshold: of the alarms.
        terrains: names of the known terrains.
        surfaces: of each of them.
    """

    trial: WatchedTrial
    states: tuple[ForesightState, ...]
    threshold: float
    terrains: tuple[str, ...]
    surfaces: tuple[str, ...]


class TrialTicks(NamedTuple):
    """Warnings and truth of one trial, row by row of its ticks.

    Attributes:
        p: probability of a slip within 0.2 s, NaN = not known, shape (n,).
        t: time of every tick [s], shape (n,).
        warned: p is at the threshold or above, shape (n,).
        at_risk: in contact, in no slip, p known, shape (n,).
        before: a slip begins within 0.2 s, shape (n,).
        alarms: first and last time of every alarm [s].
        onsets: of the slips that could be foreseen [s].
    """

    p: Array
    t: Array
    warned: np.ndarray
    at_risk: np.ndarray
    before: np.ndarray
    alarms: list[tuple[float, float]]
    onsets: list[float]


def ticks_of(run: ForesightRun) -> TrialTicks:
    """Return what was foreseen in a trial beside what came of it."""
    trial = run.trial
    by_tick = dict(zip(trial.tick.tolist(), range(trial.tick.size), strict=True))
    p = np.full(trial.tick.size, np.nan)
    is_alarm = np.zeros(trial.tick.size, dtype=np.bool_)
    for state in run.states:
        row = by_tick.get(state.cycle // EVERY)
        if row is not None:
            p[row] = state.slip_probability
            is_alarm[row] = bool(state.flags & ForesightFlag.ALARM)
    known = np.isfinite(p)
    first = float(trial.t[0]) + HORIZON if trial.t.size else 0.0
    return TrialTicks(
        p=p,
        t=trial.t,
        warned=known & (np.nan_to_num(p) >= run.threshold),
        at_risk=trial.is_at_risk & known,
        before=trial.is_before_slip,
        alarms=_stretches(trial.t, is_alarm),
        onsets=[onset for onset in trial.onsets.tolist() if onset >= first],
    )


def _stretches(t: Array, is_on: np.ndarray) -> list[tuple[float, float]]:
    """Return (first, last) time of every run of True [s]."""
    edges = np.diff(np.concatenate([[0], is_on.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [(float(t[a]), float(t[b - 1])) for a, b in zip(starts, stops, strict=True)]


def leads_of(ticks: TrialTicks) -> list[float | None]:
    """Return how early every onset was warned of [s]; None = not at all."""
    leads: list[float | None] = []
    for onset in ticks.onsets:
        last = (ticks.t < onset) & (ticks.t >= onset - HORIZON) & ticks.at_risk
        if not bool((ticks.warned & last).any()):
            leads.append(None)
            continue
        begun = [a for a, b in ticks.alarms if a < onset and b >= onset - HORIZON]
        leads.append(min(onset - min(begun), LONGEST_LEAD))
    return leads
