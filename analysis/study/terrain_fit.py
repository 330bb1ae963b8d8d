"""The Tustin fit of all trials of a terrain, and how far to believe it."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acquisition import TractionError
from analysis.data import SampleTable
from analysis.study.models import FitOptions
from analysis.tustin import Interval, TustinFit, bootstrap_tustin, fit_tustin

_STREAM = 1_000_000  # apart from the folds, which have the same kind of seed


@dataclass(frozen=True, slots=True)
class TerrainTask:
    """Everything the fit of one terrain needs.

    Attributes:
        terrain: its name.
        trials: kept samples of every trial that has any.
        options: how to fit.
    """

    terrain: str
    trials: tuple[SampleTable, ...]
    options: FitOptions


@dataclass(frozen=True, slots=True)
class PooledTustinFit:
    """Tustin parameters of a terrain with their uncertainty.

    Attributes:
        terrain: its name.
        fit: the fit of all trials; None where it was impossible.
        intervals: 95 % intervals of the parameters from resampled trials; empty with
            one trial, or where none were asked for.
    """

    terrain: str
    fit: TustinFit | None
    intervals: Mapping[str, Interval]


def fit_terrain(task: TerrainTask) -> PooledTustinFit:
    """Return the fit of all trials of a terrain; a pure function of the task."""
    options = task.options
    columns = [(rows.F_n, rows.v_t, rows.F_t) for rows in task.trials]
    try:
        F_n, v_t, F_t = (np.concatenate(c) for c in zip(*columns, strict=True))
        fit = fit_tustin(F_n, v_t, F_t, options.bounds, options.form)
    except (TractionError, ValueError):  # no trial at all unpacks into no columns
        return PooledTustinFit(task.terrain, None, {})
    if len(columns) < 2 or options.draws < 1:
        return PooledTustinFit(task.terrain, fit, {})
    key = (options.seed, zlib.crc32(task.terrain.encode()), _STREAM)
    rng = np.random.default_rng(key)
    intervals = bootstrap_tustin(columns, fit, rng, options.bounds, options.draws)
    return PooledTustinFit(task.terrain, fit, intervals)
