"""Trials as a process in time: every 10 ms from the first motion on, nothing left out.

Sticking, backward motion and fast peaks belong to it: a process cannot live in the
window of velocities alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from analysis.data.prepare import PreparedTrial, is_even, stretches
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.study.new_trial import spread_trials

STEP = 0.01  # s from one sample to the next
STILL = 0.005  # m/s below which a foot sticks
_NEAR = 1.2  # times the step, or its inverse, that a record's step may be
_FEWEST = 50  # samples of a trial
_MOVING = 0.005  # m/s, the first motion


@dataclass(frozen=True, slots=True, eq=False)
class ProcessTrial:
    """A whole trial, a sample every 10 ms.

    Attributes:
        F_n: normal force [N], shape (n,).
        v_t: velocity [m/s], shape (n,).
        F_t: traction force [N], shape (n,).
    """

    F_n: Array
    v_t: Array
    F_t: Array

    @property
    def way(self) -> float:
        """Distance that it slid forward [m]."""
        return float(STEP * np.maximum(self.v_t, 0.0).sum())

    @property
    def rows(self) -> SampleTable:
        """All of its samples."""
        return SampleTable(self.F_n, self.v_t, self.F_t)

    def take(self, rows: np.ndarray) -> "ProcessTrial":
        """Return the samples of these numbers, one after the other."""
        return ProcessTrial(self.F_n[rows], self.v_t[rows], self.F_t[rows])


def process_trial(trial: PreparedTrial) -> ProcessTrial | None:
    """Return a prepared trial as a process; None where its record cannot be one.

    It has to be even in time, and of it the longest stretch without a gap is taken.
    Rows that were prepared before lack what lay between them.
    """
    smooth, every = trial.smooth, trial.widths[1]
    if trial.is_prepared or not is_even(smooth.t):
        return None
    start, end = max(stretches(smooth.t), key=lambda part: part[1] - part[0])
    rows = np.arange(start, end, every)
    moving = np.flatnonzero(smooth.v_t[rows] >= _MOVING)
    rows = rows[moving[0] :] if moving.size else rows[:0]
    if rows.size < _FEWEST:
        return None
    step = float(np.median(np.diff(smooth.t[rows])))
    if not STEP / _NEAR < step < STEP * _NEAR:
        return None
    return ProcessTrial(smooth.F_n[rows], smooth.v_t[rows], smooth.F_t[rows])


def process_trials(trials: Sequence[PreparedTrial]) -> tuple[ProcessTrial, ...]:
    """Return 30 at most of the trials that can be a process, spread over all.

    What a generator of more costs grows with all of their samples.
    """
    found = every_process_trial(trials)
    return tuple(found[k] for k in spread_trials(len(found)))


def every_process_trial(trials: Sequence[PreparedTrial]) -> tuple[ProcessTrial, ...]:
    """Return those of the trials that can be a process."""
    found = (process_trial(trial) for trial in trials)
    return tuple(trial for trial in found if trial is not None)


class Held(NamedTuple):
    """A trial in which the foot stands still for longer than it did.

    Attributes:
        trial: the trial.
        start: first sample of the time that was added,
        end: and the one after its last.
    """

    trial: ProcessTrial
    start: int
    end: int


def held_longer(trial: ProcessTrial, seconds: float) -> Held:
    """Return a trial whose longest stick lasts `seconds` longer.

    What was recorded during the stick is repeated forth and back, without its creep.
    """
    first, last = longest_stick(trial)
    added = round(seconds / STEP)
    forth = np.arange(first, last + 1)
    there_and_back = np.concatenate([forth[::-1], forth])
    repeats = -(-added // there_and_back.size)
    more = np.tile(there_and_back, repeats)[:added]
    rows = np.arange(trial.F_t.size)
    longer = np.concatenate([rows[: last + 1], more, rows[last + 1 :]])
    found, start, end = trial.take(longer), last + 1, last + 1 + added
    v_t = found.v_t.copy()
    v_t[start:end] -= v_t[start:end].mean()
    return Held(replace(found, v_t=v_t), start, end)


def longest_stick(trial: ProcessTrial) -> tuple[int, int]:
    """Return first and last sample of the longest time in which the foot is still."""
    is_still = np.abs(trial.v_t) < STILL
    if not is_still.any():
        slowest = int(np.argmin(np.abs(trial.v_t)))
        return slowest, slowest
    edges = np.diff(np.concatenate([[0], is_still.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    longest = int(np.argmax(ends - starts))
    return int(starts[longest]), int(ends[longest]) - 1
