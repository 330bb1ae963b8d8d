"""Fits the contact law of a terrain: every number in closed form, nothing is searched.

A release is a fall to less than 0.3 of its peak, a partial drop any other. Of them

    b0, b1, s    regression of log peak on log(F_n / 3.5), F_n 3.5 N at most, at
                 releases; b1 ~ N(0.5, 0.5)
    k0, s_k      median and spread (quartiles) of the log secant of loadings
    w, h         of the way from the peak of a release to the next loading: quartiles
    mu, b        F_t on (F_n, v) at v > 0.08 m/s, the lower 60 % of it
    lam, m       partial drops over the way of loadings above 1.5 N, and the mean share
                 of what the peak has above 1.5 N that they take
    v_c          v - dF_t/dt / k on exp((F_t / peak - 1) / 0.14), in loadings above half
                 of their peak

The interval of every number is that of `spread_over_trials`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Any, NamedTuple

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.terrains.contact_law import (
    CREEP_LOAD,
    FULL_LOAD,
    RANGES,
    ContactLaw,
    ContactNumbers,
)
from analysis.terrains.loadings import (
    LEAST_LOAD,
    Interval90,
    loadings_of,
    spread_over_trials,
)
from analysis.terrains.process_rows import (
    STEP,
    STILL,
    ProcessTrial,
    process_trials,
)
from analysis.terrains.process_scores import STONES_DROP

_RELEASED = 0.3  # share of the peak
_LEAST_PEAK = 3.0  # N of a release
_PRIOR, _PRIOR_SD = 0.5, 0.5  # of b1
_MOST_STIFFNESS_SPREAD = 0.6
_QUARTILES = 1.349  # sd between those of a normal distribution
_RUNNING, _LOWER = 0.08, 60.0  # m/s; % of F_t
_FASTEST = 0.2  # m/s of a foot that slides, for constant friction
_LOADED = 0.5  # share of the peak from which creep counts
_FEWEST, _FEWEST_RELEASES = 3, 20  # trials; releases of all
_LEAST_SEEN = 3  # releases, loadings, .. of a trial that counts


class _Seen(NamedTuple):
    """What one trial says of the law."""

    releases: Array  # log peak and log(F_n / 3.5), shape (n, 2)
    stiffness: Array  # log secants, shape (n,)
    run_outs: Array  # m
    running: Array  # F_t, F_n, v, shape (n, 3)
    partial: Array  # shares of what is above 1.5 N
    way: float  # of loadings above 1.5 N [m]
    creep: Array  # speed less that of the stretch, and creep at v_c = 1, shape (n, 2)

    @property
    def is_telling(self) -> bool:
        """Whether it alone would give every number: draws may have nothing else."""
        columns = (
            self.releases,
            self.stiffness,
            self.run_outs,
            self.running,
            self.creep,
        )
        return min(map(len, columns)) >= _LEAST_SEEN


@dataclass(frozen=True, slots=True)
class ContactTask:
    """Everything the law of one terrain needs.

    Attributes:
        trials: whole trials.
        seed: of the draws of intervals.
    """

    trials: tuple[ProcessTrial, ...]
    seed: int

    @classmethod
    def of(cls, trials: Sequence[PreparedTrial], seed: int) -> "ContactTask":
        """Return the task of the trials of a terrain."""
        return cls(process_trials(trials), seed)


def contact_law_of(task: ContactTask) -> dict[str, Any]:
    """Return a law as plain values, nothing where there is none.

    A pure function of the task.
    """
    law = fit_contact_law(task.trials, task.seed)
    return {} if law is None else law.to_dict()


def fit_contact_law(trials: Sequence[ProcessTrial], seed: int) -> ContactLaw | None:
    """Return the law of a terrain; None where trials or releases are few.

    A plate has no releases, and no law: its coefficient of friction says as much.

    Args:
        trials: of one terrain.
        seed: of the draws of intervals.
    """
    seen = (_seen(trial) for trial in trials)
    each = [one for one in seen if one.is_telling]
    releases = sum(len(one.releases) for one in each)
    if len(each) < _FEWEST or releases < _FEWEST_RELEASES:
        return None
    least, most = np.array([RANGES[name] for name in ContactNumbers._fields]).T
    numbers = np.clip(_numbers(each), least, most)
    reach = spread_over_trials(each, _numbers, seed)
    ends = np.clip([numbers, numbers - reach, numbers + reach], least, most)
    intervals = {
        name: Interval90(*row)
        for name, row in zip(ContactNumbers._fields, ends.T.tolist(), strict=True)
    }
    return ContactLaw(ContactNumbers(*numbers.tolist()), intervals, len(each), releases)


def constant_friction(trials: Sequence[ProcessTrial]) -> float:
    """Return the median of F_t over F_n of a foot that slides, for comparison.

    Args:
        trials: of one terrain, in which a foot slides.
    """
    rows = SampleTable.joined([trial.rows for trial in trials])
    is_sliding = (rows.v_t >= STILL) & (rows.v_t <= _FASTEST) & (rows.F_n >= LEAST_LOAD)
    return float(np.median(rows.F_t[is_sliding] / rows.F_n[is_sliding]))


def _seen(trial: ProcessTrial) -> _Seen:
    found = loadings_of(trial, STONES_DROP)
    is_deep = found.floors < _RELEASED * found.peaks
    is_release = is_deep & (found.peaks >= _LEAST_PEAK)
    stiffness = found.stiffness[np.isfinite(found.stiffness)]
    loads = np.minimum(found.loads / FULL_LOAD, 1.0)
    above = np.maximum(found.peaks - STONES_DROP, 1e-9)
    share = np.minimum((found.peaks - found.floors - STONES_DROP) / above, 1.0)
    is_running = trial.v_t > _RUNNING
    running = np.column_stack([trial.F_t, trial.F_n, trial.v_t])[is_running]
    loadings = [slice(begin, peak + 1) for _, begin, peak in found.rows]
    forward = STEP * np.where(trial.F_t > STONES_DROP, np.maximum(trial.v_t, 0.0), 0.0)
    k = float(np.median(stiffness)) if stiffness.size else np.inf
    creep = [_creep(trial.F_t[rows], trial.v_t[rows], k) for rows in loadings]
    return _Seen(
        releases=np.log(np.column_stack([found.peaks, loads])[is_release]),
        stiffness=np.log(np.maximum(stiffness, 1.0)),
        run_outs=found.run_outs[is_release[: found.run_outs.size]],
        running=running,
        partial=share[~is_deep],
        way=float(sum(forward[rows].sum() for rows in loadings)),
        creep=np.concatenate([np.empty((0, 2)), *creep]),
    )


def _creep(F: Array, v: Array, k: float) -> Array:
    """Return speed beyond that of a stretch of stiffness k, and creep at v_c = 1."""
    if F.size < 3 or F[-1] <= 0.0:
        return np.empty((0, 2))
    load = F / F[-1]
    excess = v - np.gradient(F, STEP) / k
    unit = np.exp((load - 1.0) / CREEP_LOAD)
    return np.column_stack([excess, unit])[load > _LOADED]


def _numbers(each: Sequence[_Seen]) -> Array:
    """Return the twelve numbers of trials, in their order."""
    peaks, loads = np.concatenate([one.releases for one in each]).T
    slope, level, spread = _regressed(loads, peaks)
    stiffness = np.concatenate([one.stiffness for one in each])
    low, middle, high = np.percentile(stiffness, (25.0, 50.0, 75.0))
    run, run_shape = _weibull(np.concatenate([one.run_outs for one in each]))
    mu, viscosity = _skin(np.concatenate([one.running for one in each]))
    partial = np.concatenate([one.partial for one in each])
    way = sum(one.way for one in each)
    excess, unit = np.concatenate([one.creep for one in each]).T
    return np.array(
        ContactNumbers(
            level=level,
            load=slope,
            spread=spread,
            stiffness=float(middle),
            stiffness_spread=min(
                float(high - low) / _QUARTILES, _MOST_STIFFNESS_SPREAD
            ),
            run=run,
            run_shape=run_shape,
            mu=mu,
            viscosity=viscosity,
            partial_rate=partial.size / max(way, 1e-9),
            partial_share=float(partial.mean()) if partial.size else 0.0,
            creep=float(excess @ unit / (unit @ unit)),
        )
    )


def _regressed(loads: Array, peaks: Array) -> tuple[float, float, float]:
    """Return slope, intercept and sd of log peak over log load, with a prior."""
    u, y = loads - loads.mean(), peaks - peaks.mean()
    variance = float(y @ y) / y.size
    weight = variance / _PRIOR_SD**2
    slope = float((u @ y + weight * _PRIOR) / (u @ u + weight))
    level = float(peaks.mean() - slope * loads.mean())
    return slope, level, float(np.std(y - slope * u))


def _weibull(ways: Array) -> tuple[float, float]:
    """Return scale and shape of the Weibull distribution with these quartiles."""
    low, high = np.maximum(np.percentile(ways, (25.0, 75.0)), 1e-6)
    shape = log(log(4.0) / log(4.0 / 3.0)) / max(log(high / low), 1e-2)
    return float(high) / log(4.0) ** (1.0 / shape), shape


def _skin(running: Array) -> tuple[float, float]:
    """Return mu and b of a foot that runs."""
    F_t, F_n, v = running.T
    is_low = F_t <= np.percentile(F_t, _LOWER)
    columns = np.column_stack([np.maximum(F_n, 0.0), v])[is_low]
    mu, b = np.linalg.lstsq(columns, F_t[is_low], rcond=None)[0]
    return float(mu), float(b)
