"""What is left of F_t on trials that a model never saw, over velocity."""

from dataclasses import dataclass

import numpy as np

from analysis.data.series import Array
from analysis.study.study import TerrainResult

SHARES = (0.05, 0.5, 0.95)  # quantiles of the residual that are shown
_BINS = 10
_FEWEST = 20  # residuals of a bin that quantiles are taken of


@dataclass(frozen=True, slots=True)
class ResidualBand:
    """Quantiles of measured minus predicted F_t in bins of velocity.

    Attributes:
        v: middle of every bin [m/s], shape (k,).
        quantiles: 5 %, median and 95 % of the residual [N], shape (3, k).
        bias: mean residual over all samples [N].
        sd: their standard deviation [N].
    """

    v: Array
    quantiles: Array
    bias: float
    sd: float


def residual_band(result: TerrainResult, model: str) -> ResidualBand | None:
    """Return the held-out residuals of a model; None without a fold that has it."""
    pairs = [
        (trial.v_t, trial.F_t - fold.models[model].model.mean(trial.F_n, trial.v_t))
        for fold in result.folds
        if model in fold.models
        for trial in (result.trials[fold.fold],)
    ]
    if not pairs:
        return None
    v, residual = (np.concatenate(column) for column in zip(*pairs, strict=True))
    edges = np.linspace(v.min(), v.max(), _BINS + 1)
    place = np.clip(np.searchsorted(edges, v, "right") - 1, 0, _BINS - 1)
    full = [k for k in range(_BINS) if np.count_nonzero(place == k) >= _FEWEST]
    return ResidualBand(
        v=np.array([0.5 * (edges[k] + edges[k + 1]) for k in full]),
        quantiles=np.array([np.quantile(residual[place == k], SHARES) for k in full])
        .reshape(-1, len(SHARES))
        .T,
        bias=float(residual.mean()),
        sd=float(residual.std()),
    )
