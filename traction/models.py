"""Fit models to trials, compare them by cross-validation, load known terrains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from acquisition.errors import SettingsError
from acquisition.wording import counted
from analysis.data.samples import TrainingSet
from analysis.data.terrain_kinds import terrain_kind
from analysis.study.break_away_fit import BreakAwayOptions
from analysis.study.break_away_fit import fit_break_away as fit_of_terrains
from analysis.study.crossval import FoldResult, plan_folds, run_fold
from analysis.study.distribution import Distribution
from analysis.study.metrics import standard_error
from analysis.study.models import (
    GP_SE,
    PAPER_MODELS,
    TITLES,
    TUSTIN,
    FitOptions,
    FittedModel,
    ModelFitter,
)
from analysis.study.slip_risk import BreakAwayModel
from analysis.study.tasks import run_tasks
from analysis.study.terrain_fit import mean_of
from analysis.terrains.database import load
from analysis.terrains.known import TerrainDatabase
from analysis.terrains.points import points_of
from analysis.tustin.model import UNITS
from traction.frames import data_frame
from traction.trial_sets import by_terrain
from traction.trials import Trial

if TYPE_CHECKING:
    from traction.frames import DataFrame

_CONSTANT = "constant"  # median F_t of the training trials, the baseline
_SCORE_UNITS = {
    "mae": "N",
    "mae_error": "N",
    "rmse": "N",
    "nlpd": "nat",
    "crps": "N",
    "coverage90": "1",
}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Model:
    """A model of F_t over F_n and v_t, fitted to the trials of one terrain.

    Attributes:
        name: e.g. "tustin" or "gp_se".
        terrain: name of the terrain.
        trials: number of trials it was fitted to.
        samples: number of kept samples of these trials.
        fitted: the underlying model of `analysis.study`.
    """

    name: str
    terrain: str
    trials: int
    samples: int
    fitted: FittedModel

    def __repr__(self) -> str:
        values = ""
        if self.name == TUSTIN:
            parts = (f"{key} {self.parameters[key]:.3g} {UNITS[key]}" for key in UNITS)
            values = ": " + ", ".join(part.removesuffix(" 1") for part in parts)
        doubts = f" [{_shortened(self.flags)}]" if self.flags else ""
        return (
            f"<{TITLES[self.name]} of {self.terrain}, {counted(self.trials, 'trial')}, "
            f"{self.samples} samples{values}{doubts}>"
        )

    @property
    def parameters(self) -> dict[str, Any]:
        """Fitted parameters; those of "tustin" are mu, F_s, v_s, delta_s and b."""
        return self.fitted.describe()

    @property
    def flags(self) -> tuple[str, ...]:
        """Warnings about the fit and its parameters."""
        return self.fitted.flags

    def predict(self, F_n: ArrayLike, v_t: ArrayLike) -> Distribution:
        """Return the predictive distribution of a measured F_t, noise included.

        >>> import traction as tr
        >>> answer = tr.fit(tr.load_session("S001"), "tustin").predict(3.5, [0.02, 0.1])
        >>> answer.mean.shape, bool((answer.sd > 0).all())
        ((2,), True)

        Args:
            F_n: normal force [N], a number or shape (n,).
            v_t: slip velocity [m/s], a number or shape (n,).

        Returns:
            `.mean`, `.sd` and `.quantiles(shares)` of F_t [N], shape (n,).

        Raises:
            SettingsError: the shapes differ, or a value is not finite.
        """
        return self.fitted.predict(*points_of(F_n, v_t))


@dataclass(frozen=True, slots=True)
class ModelScore:
    """Scores of a model on held-out trials.

    Attributes:
        terrain: terrain of the trials.
        model: name of the model; "constant" is the median F_t of the training trials,
            the baseline.
        trials: number of held-out trials.
        mae: mean absolute error [N].
        mae_error: standard error of `mae` over the trials [N].
        rmse: root mean square error [N].
        nlpd: mean negative log predictive density [nat].
        crps: mean continuous ranked probability score [N].
        coverage90: share of measurements inside the 90 % band.
    """

    terrain: str
    model: str
    trials: int
    mae: float
    mae_error: float | None
    rmse: float | None
    nlpd: float | None
    crps: float | None
    coverage90: float | None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Comparison:
    """Models compared on held-out trials.

    Attributes:
        scores: by terrain, smallest error first.
        folds: every fold with its fitted models.
    """

    scores: tuple[ModelScore, ...]
    folds: tuple[FoldResult, ...]

    def __repr__(self) -> str:
        lines = [f"{'terrain':12} {'model':20} {'MAE [N]':>8}  {'90 % band':>9}"]
        for score in self.scores:
            share = score.coverage90
            inside = "" if share is None else f"  {share:9.0%}"
            lines.append(
                f"{score.terrain:12} {score.model:20} {score.mae:8.3f}{inside}"
            )
        return "\n".join(lines)

    def best(self, terrain: str) -> ModelScore:
        """Return the score with the smallest mean absolute error on a terrain.

        Raises:
            SettingsError: the terrain was not compared.
        """
        for score in self.scores:
            if score.terrain == terrain:
                return score
        names = ", ".join(dict.fromkeys(score.terrain for score in self.scores))
        raise SettingsError(
            f"There is no terrain {terrain!r}.", hint=f"The terrains are {names}."
        )

    def to_pandas(self) -> DataFrame:
        """Return a row per terrain and model; units in `attrs["units"]`.

        Raises:
            MissingLibraryError: pandas is not installed.
        """
        rows = [asdict(score) for score in self.scores]
        names = [field.name for field in fields(ModelScore)]
        return data_frame({n: [row[n] for row in rows] for n in names}, _SCORE_UNITS)


def fit(
    trials: Trial | Iterable[Trial],
    model: str = GP_SE,
    options: FitOptions | None = None,
) -> Model:
    """Return a model fitted to the kept samples of trials on one terrain.

    >>> import traction as tr
    >>> tr.fit(tr.load_session("S001"), "tustin")
    <Tustin of TF, 2 trials, ... samples: mu ..., F_s ... N, v_s ... m/s, ...>

    Args:
        trials: trials of one terrain, e.g. a session or `tables.on("S0")`.
        model: a name of `analysis.study.models.MODELS`, e.g. "tustin", "gp_se", or
            "gp_se_trial", whose bands hold for a new trial.
        options: bounds, points and seed; see `FitOptions`.

    Raises:
        SettingsError: there is no such model, the trials are of several terrains, or
            there are too few samples.
    """
    groups = by_terrain([trials] if isinstance(trials, Trial) else trials)
    if len(groups) != 1:
        names = ", ".join(groups) or "none"
        raise SettingsError(
            f"A model is fitted to trials of one terrain; these are of {names}.",
            hint='Choose one, e.g. trials.on("S0").',
        )
    ((terrain, prepared),) = groups.items()
    options = options or FitOptions()
    training = TrainingSet.of(prepared, options.gp_points, options.seed)
    fitted = ModelFitter(training, options).fit(model)
    samples = sum(trial.kept for trial in prepared)
    return Model(model, terrain, len(prepared), samples, fitted)


def compare(
    trials: Iterable[Trial],
    models: str | Sequence[str] = PAPER_MODELS,
    options: FitOptions | None = None,
    n_jobs: int | None = None,
) -> Comparison:
    """Compare models by leave-one-trial-out cross-validation.

    >>> import traction as tr
    >>> scores = tr.compare(tr.load_session("S001"), ["tustin"], n_jobs=1)
    >>> scores
    terrain      model                 MAE [N]  90 % band
    TF           tustin ...
    TF           constant ...
    >>> scores.best("TF").model
    'tustin'

    Args:
        trials: trials of one terrain or several, at least two of each.
        models: one name or several; by default the five of the paper's Fig. 9.
        options: bounds, points and seed; its `models` are ignored.
        n_jobs: processes; one per core by default. Does not change the results.

    Raises:
        SettingsError: there is no such model, or a terrain has a single trial.
    """
    groups = by_terrain(trials)
    single = [name for name, group in groups.items() if len(group) < 2]
    if single or not groups:
        raise SettingsError(
            f"No trial can be left out on {', '.join(single) or 'no terrain'}.",
            hint="Give two trials of each terrain at least.",
        )
    names = (models,) if isinstance(models, str) else tuple(models)
    fold_options = replace(options or FitOptions(), models=names)
    plan, _ = plan_folds(groups, fold_options)
    folds = tuple(run_tasks(run_fold, plan, n_jobs))
    scores = [s for terrain in groups for s in _scores(terrain, folds, names)]
    return Comparison(tuple(scores), folds)


def fit_break_away(
    trials: Iterable[Trial],
    kinds: Mapping[str, str] | None = None,
    options: BreakAwayOptions | None = None,
) -> dict[str, BreakAwayModel]:
    """Fit the break-away force of every terrain with three trials or more.

    `model.slip_risk(required, F_n)` is the probability of slip in a push from rest,
    `model.available(F_n, risk)` the traction available at that risk.

    Args:
        trials: trials of one terrain or several; stone terrains are fitted together
            and share some parameters.
        kinds: "small", "big" or "flat" by terrain; by default the paper's, by name.
        options: slip velocity threshold and number of bootstrap fits.
    """
    groups = by_terrain(trials)
    all_kinds = {name: terrain_kind(name) for name in groups} | dict(kinds or {})
    return fit_of_terrains(groups, all_kinds, options)


def load_terrains(path: Path | str) -> TerrainDatabase:
    """Return the terrain database that `traction export --terrain-db` wrote.

    `terrains.terrain("S0").predict(F_n=3.5, v_t=0.05)` is the expected traction [N],
    `.slip_risk(required, F_n)` the probability of slip in a push from rest,
    `.risk_in_motion` that of a sliding foot, and `.sample(F_n, v_t, dt, seed)` draws
    new trials along a path.

    Raises:
        SettingsError: the file cannot be read or is not a terrain database.
    """
    return load(path)


def _scores(
    terrain: str, folds: Sequence[FoldResult], models: Sequence[str]
) -> list[ModelScore]:
    of_terrain = [fold for fold in folds if fold.terrain == terrain]
    scores = [score for name in models if (score := _score(terrain, of_terrain, name))]
    scores.sort(key=lambda score: score.mae)
    if of_terrain:
        constant = [fold.constant_mae for fold in of_terrain]
        mae, error = float(np.mean(constant)), standard_error(constant)
        unknown = (None, None, None, None)
        count = len(of_terrain)
        scores.append(ModelScore(terrain, _CONSTANT, count, mae, error, *unknown))
    return scores


def _score(terrain: str, folds: Sequence[FoldResult], name: str) -> ModelScore | None:
    """Return the mean scores over the folds; None if the model was never fitted."""
    of_model = [fold.models[name].score for fold in folds if name in fold.models]
    if not of_model:
        return None
    return ModelScore(
        terrain=terrain,
        model=name,
        trials=len(of_model),
        mae=float(np.mean([score.mae for score in of_model])),
        mae_error=standard_error([score.mae for score in of_model]),
        rmse=mean_of([score.rmse for score in of_model]),
        nlpd=mean_of([score.nlpd for score in of_model]),
        crps=mean_of([score.crps for score in of_model]),
        coverage90=mean_of([score.coverage90 for score in of_model]),
    )


def _shortened(flags: Sequence[str]) -> str:
    """Return the first warning and the number of the others."""
    first, more = flags[0], len(flags) - 1
    return f"{first}, and {more} more" if more else first
