"""Export of all numbers of a study: fits.json and fits.csv."""

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from analysis.study.metrics import Score, compare, standard_error
from analysis.study.models import TUSTIN
from analysis.study.study import Study, TerrainResult, mean_of
from analysis.tustin.model import UNITS, TustinFit

SCHEMA = 1
_OTHER_UNITS = {
    "mae": "N",
    "mae_folds": "N",
    "train_rmse_folds": "N",
    "constant_mae": "N",
    "rmse": "N",
    "variance": "N^2",
    "nlpd": "nat",
    "crps": "N",
    "coverage50": "1",
    "coverage90": "1",
    "coverage95": "1",
    "standard_errors": "unit of the measure",
    "cross": "N",
    "components: between, within, measurement": "N",
    "components: tau, seconds": "s",
    "components: gain": "nat",
    "lifted_share": "1",
    "pulled_share": "1",
    "theta": "natural logarithms, inputs standardised, outputs in N",
}


class CsvRow(NamedTuple):
    """One line of fits.csv; an empty cell means all.

    Attributes:
        terrain: its name.
        model: name of the model.
        fold: number of the held-out trial, from 1; values of a fold of several trials
            are listed with the first of them.
        quantity: name of the quantity.
        value: the number.
        unit: its unit.
    """

    terrain: str
    model: str
    fold: str
    quantity: str
    value: float
    unit: str


def to_fits(study: Study) -> dict[str, Any]:
    """Convert a study to a JSON-compatible dictionary; missing numbers are None."""
    fits = {
        "schema": SCHEMA,
        "simulated": study.simulated,
        "terrains": {
            name: _terrain(result, study.options.fit.models)
            for name, result in study.terrains.items()
        },
        "cross": {model: study.cross(model) for model in study.options.fit.models},
        "units": UNITS | _OTHER_UNITS,
        "options": asdict(study.options),
        "notes": list(study.notes),
        "warnings": list(study.warnings),
    }
    return to_plain(fits)


def to_csv(study: Study, further: Iterable[CsvRow] = ()) -> str:
    """Return one line per terrain, model, fold and quantity, with its unit.

    Args:
        study: the study.
        further: additional lines.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["terrain", "model", "fold", "quantity", "value", "unit"])
    for name, result in study.terrains.items():
        for fold in result.folds:
            for model, outcome in fold.models.items():
                units = _OTHER_UNITS | {"train_rmse": "N"}
                of_fold = {"train_rmse": outcome.train_rmse}
                if model == TUSTIN:
                    of_fold, units = of_fold | outcome.model.describe(), units | UNITS
                scores = (score._asdict() for score in outcome.scores)
                values = [*zip(fold.left_out, scores, strict=True)]
                writer.writerows(
                    [_safe(name), model, k + 1, key, repr(value), units[key]]
                    for k, quantities in [*values, (fold.fold, of_fold)]
                    for key, value in quantities.items()
                )
    writer.writerows(
        [
            *(_safe(c) for c in (row.terrain, row.model, row.fold, row.quantity)),
            repr(row.value),
            row.unit,
        ]
        for row in further
    )
    return text.getvalue()


def tustin_medians(result: TerrainResult) -> dict[str, float | None]:
    """Return the median over folds of each Tustin parameter separately (Table I)."""
    folds = [fold.model.describe() for fold in result.models(TUSTIN)]
    return {
        name: float(np.median([fold[name] for fold in folds])) if folds else None
        for name in UNITS
    }


def flag_counts(result: TerrainResult, model: str) -> list[str]:
    """Return every flag of a model with the number of folds that raised it."""
    folds = result.models(model)
    flags = [flag for fold in folds for flag in fold.model.flags]
    return [
        f"{flag} in {flags.count(flag)} of {len(folds)} folds"
        for flag in dict.fromkeys(flags)
    ]


def _terrain(result: TerrainResult, models: Sequence[str]) -> dict[str, Any]:
    folds = [fold.model.describe() for fold in result.models(TUSTIN)]
    whole = result.whole
    return {
        "trials": len(result.trials),
        "kept_samples": [trial.kept for trial in result.trials],
        "slips": [len(slips) for slips in result.slips],
        "shares": [asdict(trial.shares) for trial in result.trials],
        "countable": [trial.is_countable for trial in result.trials],
        "lifted_share": result.lifted_share,
        "pulled_share": result.pulled_share,
        "tustin": {
            "median": tustin_medians(result),
            "folds": folds,
            "flags": flag_counts(result, TUSTIN),
            "all_trials": None if whole.fit is None else _whole_fit(whole.fit),
            "intervals": {key: list(ends) for key, ends in whole.intervals.items()},
        },
        "components": None if result.components is None else asdict(result.components),
        "gp": {model: _processes(result, model) for model in models if model != TUSTIN},
        "mae": {model: result.mae(model) for model in models},
        "mae_folds": {model: result.maes(model) for model in models},
        "train_rmse_folds": {
            model: result.per_trial(model, lambda fold: fold.train_rmse)
            for model in models
        },
        "constant_mae": result.constant_mae,
        **{
            key: {model: mean_of(result.scores(model, key)) for model in models}
            for key in Score._fields
            if key != "mae"
        },
        "standard_errors": {
            key: {model: standard_error(result.scores(model, key)) for model in models}
            for key in Score._fields
        },
        "paired": _paired(result, models),
    }


def _whole_fit(fit: TustinFit) -> dict[str, Any]:
    profiles = fit.profiles
    return {
        **asdict(fit.parameters),
        "sse": fit.sse,
        "flags": list(fit.flags),
        "profiles": None if profiles is None else profiles._asdict(),
    }


def _paired(result: TerrainResult, models: Sequence[str]) -> list[dict[str, Any]]:
    """Compare every pair of models over the trials, by MAE and by NLPD."""
    return [
        {"models": [first, second], "measure": key, **outcome._asdict()}
        for first, second in combinations(models, 2)
        for key in ("mae", "nlpd")
        if (outcome := compare(result.scores(first, key), result.scores(second, key)))
        is not None
    ]


def _processes(result: TerrainResult, model: str) -> dict[str, Any]:
    return {
        "folds": [
            {"fold": f.fold, "rows": f.gp_rows, **f.models[model].model.describe()}
            for f in result.folds
            if model in f.models
        ],
        "flags": flag_counts(result, model),
    }


def to_plain(value: Any) -> Any:  # noqa: ANN401
    """Convert tuples to lists and non-finite numbers to None, recursively."""
    if isinstance(value, dict):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _safe(text: str) -> str:
    """Escape text that a spreadsheet would interpret as a formula."""
    return "'" + text if text[:1] in "=+-@" else text
