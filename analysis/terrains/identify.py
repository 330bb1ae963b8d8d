"""How well the terrains of a study can be told apart, by models that never saw a trial.

Windows of motion are attributed to a terrain by two rules: the largest log density of
`recognition`, and the smallest mean absolute error, which is the paper's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data import PreparedTrial, groups_of
from analysis.study import GP_SE, Study, TerrainResult, run_tasks
from analysis.terrains.recognition import (
    Expert,
    Predictor,
    TerrainScores,
    neighbour_correlation,
    score_trial,
)

WINDOWS = (50, 100, 200)  # kept samples: 0.5, 1 and 2 s of motion
KEPT_PER_SECOND = 100  # kept samples of a second of motion
RARE = 0.01  # share of a terrain's own windows that strain it beyond the limit


@dataclass(frozen=True, slots=True)
class Confusion:
    """How often a window of one kind was taken for which.

    Attributes:
        names: kinds, m of them.
        counts: windows, rows the truth, columns the answer, shape (m, m).
    """

    names: tuple[str, ...]
    counts: np.ndarray

    @property
    def accuracy(self) -> float:
        """Mean over the kinds of the share that was recognised; NaN without windows."""
        totals = self.counts.sum(axis=1)
        present = totals > 0
        if not present.any():
            return float("nan")
        return float((self.counts.diagonal()[present] / totals[present]).mean())


def confusion_of(pairs: Sequence[tuple[str, str]]) -> Confusion:
    """Return how often each truth got each answer, by (truth, answer) pairs."""
    names = tuple(
        dict.fromkeys(name for pair in zip(*pairs, strict=True) for name in pair)
    )
    counts = np.zeros((len(names), len(names)), np.int64)
    for truth, answer in pairs:
        counts[names.index(truth), names.index(answer)] += 1
    return Confusion(names, counts)


@dataclass(frozen=True, slots=True)
class Identification:
    """How well the terrains of a study can be told apart.

    Attributes:
        rho: correlation of neighbouring residuals by terrain.
        by_density: confusions by window size [kept samples] and level ("terrain",
            "stones", "surface"), by posterior.
        by_error: the same by the smallest mean absolute error: the paper's rule.
        limits: by window size and terrain: the mean strain that nearly none of the
            terrain's own windows exceed.
    """

    rho: Mapping[str, float]
    by_density: Mapping[int, Mapping[str, Confusion]]
    by_error: Mapping[int, Mapping[str, Confusion]]
    limits: Mapping[int, Mapping[str, float]]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Sizes that at least one trial has a window of."""
        return tuple(
            size
            for size, levels in self.by_density.items()
            if levels["terrain"].counts.any()
        )


def identify_study(study: Study, model: str = GP_SE) -> Identification | None:
    """Return how well windows of trials are recognised by models that never saw them.

    Trial k of every terrain is scored by the models of fold k. None where no fold has
    the model for two terrains or more.
    """
    rho = _correlations(study, model)
    scored = _score_folds(study, model, rho)
    names = tuple(name for name in study.terrains if name in scored)
    if len(names) < 2:
        return None
    groups = groups_of(study.kinds)
    density, error, limits = {}, {}, {}
    for size in WINDOWS:
        windows = [
            (truth, scores, rows)
            for truth in names
            for scores in scored[truth]
            for rows in scores.windows(size)
        ]
        density[size], error[size] = {}, {}
        for level, group in groups.items():
            density[size][level] = confusion_of(
                [(group[t], s.likeliest_group(r, group)) for t, s, r in windows]
            )
            error[size][level] = confusion_of(
                [(group[t], group[s.least_error(r)]) for t, s, r in windows]
            )
        limits[size] = {name: own_limit(scored[name], name, size) for name in names}
    return Identification(rho, density, error, limits)


def own_limit(scored: Sequence[TerrainScores], terrain: str, size: int) -> float:
    """Return the mean strain that 99 % of a terrain's own windows stay below."""
    means = [
        float(scores.strain[rows, scores.terrains.index(terrain)].mean())
        for scores in scored
        for rows in scores.windows(size)
    ]
    return float(np.quantile(means, 1.0 - RARE)) if means else np.inf


def _correlations(study: Study, model: str) -> dict[str, float]:
    """Return rho of every terrain, from trials that its models never saw."""
    return {
        name: neighbour_correlation(
            [
                (trial, predictor(trial.F_n, trial.v_t))
                for trial, predictor in _held_out(result, model)
            ]
        )
        for name, result in study.terrains.items()
    }


def _held_out(
    result: TerrainResult, model: str
) -> list[tuple[PreparedTrial, Predictor]]:
    return [
        (result.trials[fold.fold], fold.models[model].model.predict)
        for fold in result.folds
        if model in fold.models
    ]


def _score_folds(
    study: Study, model: str, rho: Mapping[str, float]
) -> dict[str, list[TerrainScores]]:
    experts: dict[int, dict[str, Expert]] = {}
    for name, result in study.terrains.items():
        for fold in result.folds:
            if model in fold.models:
                of_fold = experts.setdefault(fold.fold, {})
                of_fold[name] = Expert(fold.models[model].model.predict, rho[name])
    tasks = [
        ScoreTask(trial, experts[k])
        for name, result in study.terrains.items()
        for k, trial in enumerate(result.trials)
        if name in experts.get(k, {}) and len(experts[k]) > 1 and trial.kept
    ]
    scored: dict[str, list[TerrainScores]] = {}
    done = run_tasks(run_score, tasks, study.options.n_jobs)
    for task, scores in zip(tasks, done, strict=True):
        scored.setdefault(task.trial.terrain, []).append(scores)
    return scored


@dataclass(frozen=True, slots=True)
class ScoreTask:
    """A trial and the experts that score it."""

    trial: PreparedTrial
    experts: Mapping[str, Expert]


def run_score(task: ScoreTask) -> TerrainScores:
    """Return how the trial fits the prediction of every expert."""
    return score_trial(task.trial, task.experts)
