"""One terrain of a study: its folds, and the Tustin fit of all its trials."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.errors import TractionError
from analysis.data.events import Slip
from analysis.data.prepare import PreparedTrial
from analysis.data.quality import PULLED, share_below
from analysis.data.samples import SampleTable
from analysis.data.terrain_kinds import Value, is_papers, kind_title
from analysis.study.crossval import FoldResult, ModelFold
from analysis.study.models import FitOptions
from analysis.study.trial_components import TrialComponents
from analysis.tustin.bootstrap import bootstrap_tustin
from analysis.tustin.identifiability import Interval
from analysis.tustin.model import TustinFit, fit_tustin

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


@dataclass(frozen=True, slots=True)
class TerrainResult:
    """One terrain of a study.

    Attributes:
        terrain: its name.
        kind: "small", "big", "flat", or its own name where that is not known.
        trials: its prepared trials.
        slips: the slips of every trial.
        folds: its folds; a trial without kept samples has none.
        whole: the Tustin fit of all its trials, with intervals.
        components: how its trials differ; None where they were not asked for, or for
            fewer than three of them.
        incline_deg: along the push, positive downhill [degrees]; None where unknown.
        factors: what else its recordings state alike, by name.
        units: of numbers among them, by name.
    """

    terrain: str
    kind: str
    trials: tuple[PreparedTrial, ...]
    slips: tuple[tuple[Slip, ...], ...]
    folds: tuple[FoldResult, ...]
    whole: PooledTustinFit
    components: TrialComponents | None = None
    incline_deg: float | None = None
    factors: Mapping[str, Value] = field(default_factory=dict[str, Value])
    units: Mapping[str, str] = field(default_factory=dict[str, str])

    @property
    def is_papers(self) -> bool:
        """Whether it is one of the paper's eight terrains: name, stones and incline."""
        return is_papers(self.terrain, self.kind, self.incline_deg)

    @property
    def title(self) -> str:
        """Its name and its kind in words, e.g. "S0: small stones"."""
        if self.kind == self.terrain:
            return self.terrain
        return f"{self.terrain}: {kind_title(self.kind)}"

    def per_trial(
        self, model: str, measure: Callable[[ModelFold], float]
    ) -> list[float | None]:
        """Return a measure of a model's fold for every trial, None where missing."""
        values: list[float | None] = [None] * len(self.trials)
        for fold in self.folds:
            if model in fold.models:
                for k in fold.left_out:
                    values[k] = measure(fold.models[model])
        return values

    def scores(self, model: str, key: str) -> list[float | None]:
        """Return the measure `key` of a model on every trial, None where missing."""
        values: list[float | None] = [None] * len(self.trials)
        for fold in self.folds:
            if model in fold.models:
                pairs = zip(fold.left_out, fold.models[model].scores, strict=True)
                for k, of_trial in pairs:
                    values[k] = getattr(of_trial, key)
        return values

    def left_out(self, model: str) -> list[tuple[int, ModelFold]]:
        """Return the number of every trial with the model that it was left out of.

        In the order of the folds.
        """
        return [
            (k, fold.models[model])
            for fold in self.folds
            if model in fold.models
            for k in fold.left_out
        ]

    def maes(self, model: str) -> list[float | None]:
        """Return the mean absolute error [N] on every trial, left out in turn."""
        return self.scores(model, "mae")

    def mae(self, model: str) -> float | None:
        """Return the mean over folds of the mean absolute error [N]."""
        return mean_of(self.maes(model))

    @property
    def constant_mae(self) -> float | None:
        """Error [N] of always predicting the training rows' median F_t."""
        return mean_of([fold.constant_mae for fold in self.folds])

    @property
    def kept(self) -> int:
        """Number of kept samples of all trials."""
        return sum(trial.kept for trial in self.trials)

    @property
    def lifted_share(self) -> float:
        """Share of the kept samples with F_n <= 0: the foot off the ground."""
        return share_below(self.trials, 0.0)

    @property
    def pulled_share(self) -> float:
        """Share of the kept samples with F_n below what a sound sensor shows."""
        return share_below(self.trials, -PULLED)

    def models(self, name: str) -> list[ModelFold]:
        """Return the folds of the model `name`."""
        return [fold.models[name] for fold in self.folds if name in fold.models]


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


def mean_of(values: Sequence[float | None]) -> float | None:
    """Return the mean of the values that exist, None if none does."""
    present = [value for value in values if value is not None]
    return float(np.mean(present)) if present else None
