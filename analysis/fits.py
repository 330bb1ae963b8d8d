"""Every number of a study as plain values: fits.json and fits.csv."""

import csv
import io
import math
from dataclasses import asdict
from typing import Any

import numpy as np

from analysis.models import FITTERS, TUSTIN
from analysis.study import Study, TerrainResult, mean_of
from analysis.tustin import UNITS

SCHEMA = 1
_OTHER_UNITS = {
    "mae": "N",
    "mae_folds": "N",
    "train_rmse_folds": "N",
    "constant_mae": "N",
    "rmse": "N",
    "variance": "N^2",
    "coverage95": "1",
    "cross": "N",
    "lifted_share": "1",
    "theta": "natural logarithms, inputs standardised, outputs in N",
}


def to_fits(study: Study) -> dict[str, Any]:
    """Return the study as a dictionary that is valid JSON: a missing number is None."""
    fits = {
        "schema": SCHEMA,
        "simulated": study.simulated,
        "terrains": {name: _terrain(r) for name, r in study.terrains.items()},
        "cross": {model: study.cross(model) for model in FITTERS},
        "units": UNITS | _OTHER_UNITS,
        "options": asdict(study.options),
        "notes": list(study.notes),
        "warnings": list(study.warnings),
    }
    return _plain(fits)


def to_csv(study: Study) -> str:
    """Return one line per terrain, model, fold and quantity, with its unit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["terrain", "model", "fold", "quantity", "value", "unit"])
    for name, result in study.terrains.items():
        for fold in result.folds:
            for model, outcome in fold.models.items():
                values = outcome.score._asdict() | {"train_rmse": outcome.train_rmse}
                units = _OTHER_UNITS | {"train_rmse": "N"}
                if model == TUSTIN:
                    values, units = values | outcome.model.describe(), units | UNITS
                writer.writerows(
                    [_safe(name), model, fold.fold + 1, key, repr(value), units[key]]
                    for key, value in values.items()
                )
    return text.getvalue()


def tustin_medians(result: TerrainResult) -> dict[str, float | None]:
    """Return the median over folds of each Tustin parameter by itself (Table I)."""
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


def _terrain(result: TerrainResult) -> dict[str, Any]:
    folds = [fold.model.describe() for fold in result.models(TUSTIN)]
    return {
        "trials": len(result.trials),
        "kept_samples": [trial.kept for trial in result.trials],
        "slips": [len(slips) for slips in result.slips],
        "shares": [asdict(trial.shares) for trial in result.trials],
        "countable": [trial.is_countable for trial in result.trials],
        "lifted_share": result.lifted_share,
        "tustin": {
            "median": tustin_medians(result),
            "folds": folds,
            "flags": flag_counts(result, TUSTIN),
        },
        "gp": {
            model: _processes(result, model) for model in FITTERS if model != TUSTIN
        },
        "mae": {model: result.mae(model) for model in FITTERS},
        "mae_folds": {model: result.maes(model) for model in FITTERS},
        "train_rmse_folds": {
            model: result.per_trial(model, lambda fold: fold.train_rmse)
            for model in FITTERS
        },
        "constant_mae": result.constant_mae,
        **{
            key: {model: _mean_score(result, model, key) for model in FITTERS}
            for key in ("rmse", "coverage95", "variance")
        },
    }


def _mean_score(result: TerrainResult, model: str, key: str) -> float | None:
    return mean_of(result.per_trial(model, lambda fold: getattr(fold.score, key)))


def _processes(result: TerrainResult, model: str) -> dict[str, Any]:
    return {
        "folds": [
            {"fold": f.fold, "rows": f.gp_rows, **f.models[model].model.describe()}
            for f in result.folds
            if model in f.models
        ],
        "flags": flag_counts(result, model),
    }


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return `value` with tuples as lists and numbers that are not finite as None."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _safe(text: str) -> str:
    """Return text that a spreadsheet will not take for a formula."""
    return "'" + text if text[:1] in "=+-@" else text
