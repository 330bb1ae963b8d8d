"""Terrain database of a study: models fitted to all trials and tabulated."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.errors import SettingsError, TractionError
from analysis.data.prepare import PreparedTrial, PrepareOptions
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import Array
from analysis.study.distribution import SHARES
from analysis.study.models import GP_SE, GP_SE_TRIAL, TITLES, FitOptions, ModelFitter
from analysis.study.store import ResultStore
from analysis.study.study import Study
from analysis.study.tasks import Workers, run_tasks
from analysis.study.terrain_fit import TerrainResult
from analysis.terrains.database import to_text
from analysis.terrains.identify import Identification
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.path_copula import PathCopula, ScoredTrial, fit_copula
from analysis.terrains.table import Table, rows_of

POINTS = 32  # per axis
_LOAD_PERCENTILE = 99.8  # percentile of F_n that sets the range of the tables
_MARGIN = 1.2  # factor on that percentile
_STREAM = 2_000_000  # random stream, distinct from folds and terrain fits


@dataclass(frozen=True, slots=True)
class TableTask:
    """Input for the tables of one terrain.

    Attributes:
        terrain: its name.
        trials: kept samples of every non-empty trial.
        axes: points of the tables: F_n [N] and v_t [m/s].
        options: options of the fits.
    """

    terrain: str
    trials: tuple[SampleTable, ...]
    axes: tuple[Array, Array]
    options: FitOptions


def tabulate(task: TableTask) -> dict[str, dict[str, Any]]:
    """Fit models to all trials of a terrain and tabulate them; pure.

    Returns the parameters of each model and its quantiles of F_t [N], an array of shape
    (q, n, m) over the axes. A model that cannot be fitted is left out.
    """
    F_n, v_t = (grid.ravel() for grid in np.meshgrid(*task.axes, indexing="ij"))
    fitter = ModelFitter(training_set(task), task.options)
    shape = (len(SHARES), task.axes[0].size, task.axes[1].size)
    models: dict[str, dict[str, Any]] = {}
    for name in task.options.models:
        try:
            model = fitter.fit(name)
        except TractionError:
            continue
        forces = model.predict(F_n, v_t).quantiles(SHARES)
        models[name] = {
            "parameters": model.describe(),
            "quantiles": forces.reshape(shape),
        }
    return models


def training_set(task: TableTask) -> TrainingSet:
    """Return the samples of all trials, with the rows for the processes drawn."""
    rows = SampleTable.joined(task.trials)
    key = (task.options.seed, zlib.crc32(task.terrain.encode()), _STREAM)
    count = min(task.options.gp_points, rows.count)
    chosen = np.random.default_rng(key).choice(rows.count, count, replace=False)
    return TrainingSet(rows, tuple(trial.count for trial in task.trials), chosen)


def database_of(
    study: Study,
    identification: Identification | None,
    made_utc: str,
    workers: Workers | int | None = None,
    store: ResultStore | None = None,
) -> str:
    """Make the text of a terrain database with every terrain of a study.

    Args:
        study: trials and fit options.
        identification: terrain classification; provides correlations and limits.
        made_utc: time stamp of the database.
        workers: processes that fit the models.
        store: cache of earlier results.

    Raises:
        SettingsError: no terrain has kept samples.
    """
    axes, tasks = _tasks(study)
    tables = run_tasks(tabulate, tasks, workers, store=store)
    models = study.options.fit.models
    default = next((m for m in (GP_SE_TRIAL, GP_SE) if m in models), models[0])
    recogniser = GP_SE if GP_SE in models else default
    known = {
        task.terrain: KnownTerrain(
            name=task.terrain,
            kind=study.kinds[task.terrain],
            incline_deg=study.terrains[task.terrain].incline_deg,
            factors=study.terrains[task.terrain].factors,
            trials=len(task.trials),
            samples=sum(rows.count for rows in task.trials),
            rho=_rho(identification, task.terrain),
            limits=_limits(identification, task.terrain),
            tables={n: _table(m["quantiles"], axes) for n, m in fitted.items()},
            parameters={n: m["parameters"] for n, m in fitted.items()},
            default=default,
            titles={name: TITLES[name] for name in fitted},
            recogniser=recogniser,
            roughness=_roughness(identification, task.terrain),
            break_away=study.break_away.get(task.terrain),
            copula=copula_of(
                study.terrains[task.terrain], default, study.options.prepare.slowest
            ),
        )
        for task, fitted in zip(tasks, tables, strict=True)
        if default in fitted and recogniser in fitted
    }
    surfaces = None if identification is None else identification.classifier
    return to_text(TerrainDatabase(known, study.simulated, made_utc, surfaces))


def copula_of(result: TerrainResult, model: str, slowest: float) -> PathCopula | None:
    """Fit the copula of a terrain's trials; None with too few trials.

    Each trial is scored by the model fitted without it.

    Args:
        result: results of the terrain with its folds.
        model: name of the model.
        slowest: speed below which the foot sticks [m/s].
    """
    held_out = [(result.trials[k], fold.model) for k, fold in result.left_out(model)]
    scored = [
        ScoredTrial.of(trial, fitted.predict(trial.F_n, trial.v_t), slowest)
        for trial, fitted in held_out
    ]
    return fit_copula(scored)


def _table(forces: Array, axes: tuple[Array, Array]) -> Table:
    F_n, v_t = (tuple(axis.tolist()) for axis in axes)
    return Table(F_n, v_t, SHARES, tuple(map(rows_of, forces)))


def _tasks(study: Study) -> tuple[tuple[Array, Array], list[TableTask]]:
    """Return the axes of all tables, and one task per terrain with kept samples."""
    trials = {
        name: tuple(trial for trial in result.trials if trial.kept)
        for name, result in study.terrains.items()
    }
    trials = {name: own for name, own in trials.items() if own}
    if not trials:
        raise SettingsError("No terrain has kept samples.", hint="Record some trials.")
    axes = _axes([t for own in trials.values() for t in own], study.options.prepare)
    return axes, [
        TableTask(
            name,
            tuple(SampleTable.of([trial]) for trial in own),
            axes,
            study.options.fit,
        )
        for name, own in trials.items()
    ]


def _rho(identification: Identification | None, terrain: str) -> float:
    """Return the correlation of neighbouring residuals; 0 if not known."""
    return 0.0 if identification is None else round(identification.rho[terrain], 4)


def _axes(
    trials: Sequence[PreparedTrial], options: PrepareOptions
) -> tuple[Array, Array]:
    """Return F_n [N] up to a high percentile, v_t [m/s] in geometric steps."""
    loads = np.concatenate([trial.F_n for trial in trials])
    most = max(_MARGIN * float(np.percentile(loads, _LOAD_PERCENTILE)), 1.0)
    least = min(float(np.percentile(loads, 100.0 - _LOAD_PERCENTILE)), 0.0)
    v_t = np.geomspace(options.slowest, options.fastest, POINTS)
    return np.round(np.linspace(least, most, POINTS), 6), np.round(v_t, 8)


def _limits(identification: Identification | None, terrain: str) -> Mapping[int, float]:
    if identification is None:
        return {}
    return {
        size: round(limits[terrain].strain, 4)
        for size, limits in identification.limits.items()
        if terrain in limits and np.isfinite(limits[terrain].strain)
    }


def _roughness(
    identification: Identification | None, terrain: str
) -> Mapping[int, float]:
    if identification is None:
        return {}
    return {
        size: round(limits[terrain].roughness, 4)
        for size, limits in identification.limits.items()
        if terrain in limits and np.isfinite(limits[terrain].roughness)
    }
