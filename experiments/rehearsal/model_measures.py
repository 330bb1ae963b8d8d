"""Measures of groups A, B and C, and E7: models of a study."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.data.terrain_kinds import FLAT
from analysis.study.crossval import ModelFold
from analysis.study.models import GP_SE, TUSTIN, TustinModel
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_MODELS = (TUSTIN, GP_SE)
_SIGNIFICANT = 0.05


@dataclass(frozen=True, slots=True)
class _Errors:
    """Mean absolute errors [N] of one kind of model.

    Attributes:
        cells: [model's terrain][tested terrain] -> error of every fold, in order.
    """

    cells: dict[str, dict[str, list[float]]]

    def mean(self, terrain: str, tested: str) -> float:
        return float(np.mean(self.cells[terrain][tested]))

    def ratio(self, terrain: str, tested: str) -> float:
        """Ratio of the error of another terrain's model to that of its own."""
        return self.mean(terrain, tested) / self.mean(tested, tested)


def measure_models(study: Study) -> dict[str, list[float]]:
    """Return the values of A1 to C4 and E7, by id.

    Args:
        study: study of all terrains, with Tustin and GP-SE models. Flat terrains are
            plates, all others stones.
    """
    flats = [name for name, kind in study.kinds.items() if kind == FLAT]
    stones = [name for name, kind in study.kinds.items() if kind != FLAT]
    if not (flats and stones):
        return {}
    errors = {model: _errors_of(study, model) for model in _MODELS}
    results = study.terrains
    return {
        **_own(errors, stones, flats),
        **_foreign(errors, stones, flats),
        **_chosen(errors[GP_SE], stones),
        **_spread(study, stones, flats),
        "A6": [float(np.mean([_r2(results[name]) for name in stones]))],
        "E7": [_median_b(results[name]) for name in stones],
    }


def _errors_of(study: Study, model: str) -> _Errors:
    return _Errors(
        {
            name: {
                tested: [
                    error
                    for fold in result.models(model)
                    for error in (
                        [score.mae for score in fold.scores]
                        if tested == name
                        else fold.cross[tested]
                    )
                ]
                for tested in study.terrains
            }
            for name, result in study.terrains.items()
        }
    )


def _own(
    errors: dict[str, _Errors], stones: list[str], flats: list[str]
) -> dict[str, list[float]]:
    own = {m: {n: errors[m].mean(n, n) for n in (*stones, *flats)} for m in _MODELS}
    on_plates = [own[model][name] for model in _MODELS for name in flats]
    plate = float(np.mean(on_plates))
    return {
        "A1": on_plates,
        "A2": [plate],
        "A3": [own[model][name] / plate for model in _MODELS for name in stones],
        "A4": [float(np.mean([own[GP_SE][name] for name in stones]))],
        "A5": [abs(own[TUSTIN][n] - e) / e for n, e in own[GP_SE].items()],
    }


def _foreign(
    errors: dict[str, _Errors], stones: list[str], flats: list[str]
) -> dict[str, list[float]]:
    gp = errors[GP_SE]
    among = [
        errors[model].ratio(name, tested)
        for model in _MODELS
        for name in stones
        for tested in stones
        if name != tested
    ]
    to_own = [
        errors[model].mean(flat, stone) / errors[model].mean(flat, flat)
        for model in _MODELS
        for flat in flats
        for stone in stones
    ]
    tread, bare = flats[0], flats[-1]
    worse = [
        _is_worse(gp, name, tested)
        for name, tested in (
            *((flat, stone) for flat in flats for stone in stones),
            *((stone, flat) for flat in flats for stone in stones),
        )
    ]
    return {
        "B1": among,
        "B2": [float(np.mean(among))],
        "B3": [float(np.mean([gp.ratio(tread, stone) for stone in stones]))],
        "B4": [float(np.mean([gp.ratio(bare, stone) for stone in stones]))],
        "B5": to_own,
        "B6": [gp.ratio(stone, tread) for stone in stones],
        "B7": [gp.ratio(stone, bare) for stone in stones],
        "B10": [float(sum(worse))],
    }


def _is_worse(errors: _Errors, name: str, tested: str) -> bool:
    """Whether a foreign model is worse than the own one, paired over the folds."""
    stats: Any = import_module("scipy.stats")  # it has no stubs
    foreign, own = errors.cells[name][tested], errors.cells[tested][tested]
    count = min(len(foreign), len(own))
    if count < 2 or foreign[:count] == own[:count]:
        return False
    test = stats.wilcoxon(foreign[:count], own[:count], alternative="greater")
    return bool(test.pvalue < _SIGNIFICANT)


def _chosen(errors: _Errors, stones: list[str]) -> dict[str, list[float]]:
    """Share of trials whose best model is that of the right terrain or class."""
    is_class: list[bool] = []
    is_exact: list[bool] = []
    for tested in errors.cells:
        trials = min(len(row[tested]) for row in errors.cells.values())
        for k in range(trials):
            best = min(errors.cells, key=lambda name: errors.cells[name][tested][k])
            is_exact.append(best == tested)
            is_class.append((best in stones) == (tested in stones))
    return {"B8": [float(np.mean(is_class))], "B9": [float(np.mean(is_exact))]}


def _spread(
    study: Study, stones: list[str], flats: list[str]
) -> dict[str, list[float]]:
    results = study.terrains
    lag1, lag5 = zip(
        *(_autocorrelations(results[name]) for name in stones), strict=True
    )
    smallest = min(_mean_of_folds(results[name], "variance") for name in stones)
    largest = max(_mean_of_folds(results[name], "variance") for name in flats)
    return {
        "C1": [smallest / largest],
        "C2": [_mean_of_folds(results[name], "coverage95") for name in stones],
        "C3": list(lag1),
        "C4": [float(np.mean(lag5))],
    }


def _mean_of_folds(result: TerrainResult, measure: str) -> float:
    return float(np.mean([getattr(f.score, measure) for f in result.models(GP_SE)]))


def _held_out(result: TerrainResult) -> list[tuple[PreparedTrial, ModelFold]]:
    return [(result.trials[k], fold) for k, fold in result.left_out(GP_SE)]


def _residual(trial: PreparedTrial, fold: ModelFold) -> Array:
    return trial.F_t - fold.model.mean(trial.F_n, trial.v_t)


def _r2(result: TerrainResult) -> float:
    """Coefficient of determination on held-out trials."""
    pairs = _held_out(result)
    residuals = np.concatenate([_residual(*pair) for pair in pairs])
    F_t = np.concatenate([trial.F_t for trial, _ in pairs])
    return float(1.0 - (residuals**2).sum() / ((F_t - F_t.mean()) ** 2).sum())


def _autocorrelations(result: TerrainResult) -> tuple[float, float]:
    """Autocorrelation of the residuals at lags of one and five kept samples."""
    lag1: list[float] = []
    lag5: list[float] = []
    for trial, fold in _held_out(result):
        residuals = _residual(trial, fold)
        lag1.append(_autocorrelation(residuals, trial, 1))
        lag5.append(_autocorrelation(residuals, trial, 5))
    return float(np.nanmean(lag1)), float(np.nanmean(lag5))


def _autocorrelation(residuals: Array, trial: PreparedTrial, lag: int) -> float:
    """Autocorrelation of residuals at a `lag` in kept samples, without gaps."""
    step = int(np.min(np.diff(trial.indices)))
    is_near = trial.indices[lag:] - trial.indices[:-lag] == lag * step
    if np.count_nonzero(is_near) < 3:
        return float("nan")
    before, after = residuals[:-lag][is_near], residuals[lag:][is_near]
    return float(np.corrcoef(before, after)[0, 1])


def _median_b(result: TerrainResult) -> float:
    fits = [fold.model for fold in result.models(TUSTIN)]
    return float(
        np.median([m.fit.parameters.b for m in fits if isinstance(m, TustinModel)])
    )
