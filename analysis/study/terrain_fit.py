"""Results of one terrain: its folds, and the Tustin fit to all its trials."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from acquisition.errors import TractionError
from analysis.data.events import Slip
from analysis.data.prepare import PreparedTrial
from analysis.data.quality import PULLED, share_below
from analysis.data.samples import SampleTable
from analysis.data.terrain_kinds import Value, is_paper_terrain, kind_title
from analysis.study.crossval import FoldResult, ModelFold
from analysis.study.models import FitOptions
from analysis.study.trial_components import TrialComponents
from analysis.tustin.bootstrap import bootstrap_tustin
from analysis.tustin.identifiability import Interval
from analysis.tustin.model import TustinFit, fit_tustin

_STREAM = 1_000_000  # random stream, distinct from the folds


@dataclass(frozen=True, slots=True)
class TerrainTask:
    """Input for the fit of one terrain.

    Attributes:
        terrain: its name.
        trials: kept samples of every non-empty trial.
        options: options of the fits.
    """

    terrain: str
    trials: tuple[SampleTable, ...]
    options: FitOptions


@dataclass(frozen=True, slots=True)
class PooledTustinFit:
    """Tustin parameters of a terrain with their uncertainty.

    Attributes:
        terrain: its name.
        fit: fit to all trials; None if it was impossible.
        intervals: 95 % bootstrap intervals of the parameters; empty with one trial or
            if not requested.
    """

    terrain: str
    fit: TustinFit | None
    intervals: Mapping[str, Interval]


@dataclass(frozen=True, slots=True)
class TerrainResult:
    """Results of one terrain of a study.

    Attributes:
        terrain: its name.
        kind: "small", "big", "flat", or its own name if not known.
        trials: prepared trials.
        slips: slips of every trial.
        folds: folds; a trial without kept samples has none.
        whole: Tustin fit to all trials, with intervals.
        components: variance components; None if not requested or with fewer than three
            trials.
        incline_deg: along the push, positive downhill [degrees]; None if unknown.
        factors: further factors stated consistently by its recordings, by name.
        units: units of numeric factors by name.
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
    def is_paper_terrain(self) -> bool:
        """Whether name, stones and incline match one of the paper's eight terrains."""
        return is_paper_terrain(self.terrain, self.kind, self.incline_deg)

    @property
    def title(self) -> str:
        """Name and kind in words, e.g. "S0: small stones"."""
        if self.kind == self.terrain:
            return self.terrain
        return f"{self.terrain}: {kind_title(self.kind)}"

    def per_trial(
        self, model: str, measure: Callable[[ModelFold], float]
    ) -> list[float | None]:
        """Return a measure of a model's fold for every trial; None if missing."""
        values: list[float | None] = [None] * len(self.trials)
        for fold in self.folds:
            if model in fold.models:
                for k in fold.left_out:
                    values[k] = measure(fold.models[model])
        return values

    def scores(self, model: str, key: str) -> list[float | None]:
        """Return the score `key` of a model on every trial; None if missing."""
        values: list[float | None] = [None] * len(self.trials)
        for fold in self.folds:
            if model in fold.models:
                pairs = zip(fold.left_out, fold.models[model].scores, strict=True)
                for k, of_trial in pairs:
                    values[k] = getattr(of_trial, key)
        return values

    def left_out(self, model: str) -> list[tuple[int, ModelFold]]:
        """Return the number of every held-out trial with the model fitted without it.

        The trials are in the order of the folds.
        """
        return [
            (k, fold.models[model])
            for fold in self.folds
            if model in fold.models
            for k in fold.left_out
        ]

    def maes(self, model: str) -> list[float | None]:
        """Return the mean absolute error [N] on every held-out trial."""
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
        """Share of the kept samples with F_n below the error of a sound sensor."""
        return share_below(self.trials, -PULLED)

    def models(self, name: str) -> list[ModelFold]:
        """Return the folds of the model `name`."""
        return [fold.models[name] for fold in self.folds if name in fold.models]


def fit_terrain(task: TerrainTask) -> PooledTustinFit:
    """Fit the Tustin model to all trials of a terrain; pure."""
    options = task.options
    columns = [(rows.F_n, rows.v_t, rows.F_t) for rows in task.trials]
    try:
        F_n, v_t, F_t = (np.concatenate(c) for c in zip(*columns, strict=True))
        fit = fit_tustin(F_n, v_t, F_t, options.bounds, options.form)
    except (TractionError, ValueError):  # ValueError: no trials to unpack
        return PooledTustinFit(task.terrain, None, {})
    if len(columns) < 2 or options.draws < 1:
        return PooledTustinFit(task.terrain, fit, {})
    key = (options.seed, zlib.crc32(task.terrain.encode()), _STREAM)
    rng = np.random.default_rng(key)
    intervals = bootstrap_tustin(columns, fit, rng, options.bounds, options.draws)
    return PooledTustinFit(task.terrain, fit, intervals)


def mean_of(values: Sequence[float | None]) -> float | None:
    """Return the mean of the values that are not None; None if all are."""
    present = [value for value in values if value is not None]
    return float(np.mean(present)) if present else None
