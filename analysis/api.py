"""The analysis for notebooks: from a file to models, in seven functions.

    trial = load_trial(Path("T04.mcap"))            # a recorded trial, or
    trials = load_tables([Path("trials.npz")])      # tables, by terrain
    kept = [prepare(series) for series in trials["TF"]]
    curve = fit_tustin(kept)                        # eq. 1
    process = fit_gp(kept)                          # eqs. 4 to 7
    folds = crossvalidate({"TF": kept})             # one whole trial left out at a time
    rest = fit_break_away({"TF": kept})["TF"]       # before a foot at rest slips
    known = load_terrains("terrains.json")          # of traction export --terrain-db

Forces are in N, velocities in m/s; v_t and F_t are positive in ordinary slip, F_n in
compression. A fitted model predicts with `model.predict(F_n, v_t)`: mean, standard
deviation and quantiles of a measurement. `rest.slip_risk(required, F_n)` and
`rest.available(F_n, risk)` answer for a push from rest, `risk_in_motion` of a terrain
of `known` for a foot that slides. All functions are pure but those that load.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from analysis.breakaway.answers import AvailableForce, BreakAwayRisk
from analysis.breakaway.fitting import fit_break_away as fit_of_terrains
from analysis.breakaway.model import BreakAwayModel
from analysis.breakaway.recorded import BreakAwayOptions
from analysis.data.load import RecordedTrial, load_trial
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import TractionSeries
from analysis.data.tables import load_tables
from analysis.data.terrain_kinds import terrain_kind
from analysis.study.crossval import FoldResult, plan_folds, run_fold
from analysis.study.jobs import run_tasks
from analysis.study.models import (
    FITTERS,
    GP_NN,
    GP_NN_TUSTIN,
    GP_SE,
    GP_SE_NOISE,
    GP_SE_TRIAL,
    GP_SE_TUSTIN,
    TUSTIN,
    FitOptions,
    FittedModel,
    ModelFitter,
    TustinModel,
)
from analysis.terrains.database import load
from analysis.terrains.known import TerrainDatabase
from analysis.terrains.table import SlipRisk

__all__ = [
    "FITTERS",
    "GP_NN",
    "GP_NN_TUSTIN",
    "GP_SE",
    "GP_SE_NOISE",
    "GP_SE_TRIAL",
    "GP_SE_TUSTIN",
    "TUSTIN",
    "AvailableForce",
    "BreakAwayModel",
    "BreakAwayOptions",
    "BreakAwayRisk",
    "FitOptions",
    "FittedModel",
    "FoldResult",
    "PrepareOptions",
    "PreparedTrial",
    "RecordedTrial",
    "SlipRisk",
    "TerrainDatabase",
    "TractionSeries",
    "crossvalidate",
    "fit_break_away",
    "fit_gp",
    "fit_tustin",
    "load_tables",
    "load_terrains",
    "load_trial",
    "prepare",
]


def prepare(
    trial: RecordedTrial | TractionSeries, options: PrepareOptions | None = None
) -> PreparedTrial:
    """Return the kept samples of a trial: smoothed, thinned, inside the window.

    Args:
        trial: from `load_trial`, or one of `load_tables`.
        options: width of the average, thinning and window; the paper's by default.
    """
    series = trial.series() if isinstance(trial, RecordedTrial) else trial
    return prepare_trial(series, options or PrepareOptions())


def fit_tustin(
    trials: Sequence[PreparedTrial], options: FitOptions | None = None
) -> TustinModel:
    """Return the Tustin model (eq. 1) of all kept samples of `trials`.

    Raises:
        SettingsError: fewer than 20 samples.
    """
    options = options or FitOptions()
    return TustinModel(ModelFitter(_training(trials, options), options).curve())


def fit_gp(
    trials: Sequence[PreparedTrial],
    model: str = GP_SE,
    options: FitOptions | None = None,
) -> FittedModel:
    """Return a Gaussian process on `options.gp_points` samples chosen at random.

    Args:
        trials: prepared trials of one terrain.
        model: "gp_se", "gp_nn", "gp_se_tustin", "gp_nn_tustin", "gp_se_noise" or, for
            bands that hold for a trial to come, "gp_se_trial" and the like.
        options: number and seed of the samples, and more.

    Raises:
        SettingsError: fewer than 20 samples, forces that do not vary, or no such model.
    """
    options = options or FitOptions()
    return ModelFitter(_training(trials, options), options).fit(model)


def crossvalidate(
    trials: Mapping[str, Sequence[PreparedTrial]],
    options: FitOptions | None = None,
    n_jobs: int | None = None,
) -> list[FoldResult]:
    """Return every fold: models by name with their scores on the trial left out.

    Args:
        trials: prepared trials by terrain; the models of each terrain are also tested
            on the others.
        options: which models, and how they are fitted.
        n_jobs: processes; one per core by default. Does not change the results.
    """
    tasks, _ = plan_folds(trials, options or FitOptions())
    return run_tasks(run_fold, tasks, n_jobs)


def fit_break_away(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str] | None = None,
    options: BreakAwayOptions | None = None,
) -> dict[str, BreakAwayModel]:
    """Return what every terrain of three trials or more gives before a foot slips.

    Args:
        trials: prepared trials by terrain; stones share what they have in common.
        kinds: "small", "big" or "flat" by terrain; by default the paper's, by name.
        options: velocity that makes a slip, and number of resampled fits.
    """
    known = {name: terrain_kind(name) for name in trials} | dict(kinds or {})
    return fit_of_terrains(trials, known, options)


def load_terrains(path: Path | str) -> TerrainDatabase:
    """Return a terrain database: `slip_risk` from rest, `risk_in_motion` of sliding.

    Raises:
        SettingsError: the file cannot be read or is none.
    """
    return load(path)


def _training(trials: Sequence[PreparedTrial], options: FitOptions) -> TrainingSet:
    rows = SampleTable.of(trials)
    count = min(options.gp_points, rows.count)
    rng = np.random.default_rng(options.seed)
    chosen = rng.choice(rows.count, count, replace=False)
    return TrainingSet(rows, tuple(trial.kept for trial in trials), chosen)
