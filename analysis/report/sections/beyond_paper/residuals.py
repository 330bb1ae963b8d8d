"""Residuals, measured minus predicted F_t, of held-out trials."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import (
    FIRST_COLOUR,
    SECOND_COLOUR,
    SPEED_LABEL,
    Figure,
    panel_grid,
    plain,
)
from analysis.study.models import GP_SE, TITLES, TUSTIN
from analysis.study.terrain_fit import TerrainResult
from analysis.tustin.identifiability import correlation_samples

RESIDUAL_MODELS = (TUSTIN, GP_SE)
SHARES = (0.05, 0.5, 0.95)  # quantiles of the residual that are shown
_BINS = 10
_FEWEST = 20  # smallest number of residuals in a bin for quantiles


@dataclass(frozen=True, slots=True)
class ResidualBand:
    """Quantiles of measured minus predicted F_t in bins of velocity.

    Attributes:
        v: middle of every bin [m/s], shape (k,).
        quantiles: 5 %, median and 95 % of the residual [N], shape (3, k).
        bias: mean residual over all samples [N].
        sd: standard deviation of the residuals [N].
        samples: number of residuals.
        correlation: correlation of residuals one kept sample apart.
        time: integrated autocorrelation time [kept samples].
    """

    v: Array
    quantiles: Array
    bias: float
    sd: float
    samples: int
    correlation: float
    time: float

    @property
    def independent(self) -> float:
        """Effective number of independent samples of the residuals."""
        return self.samples / self.time

    def numbers(self) -> dict[str, Any]:
        """Return the band as plain values for fits.json."""
        return {
            "v_t": self.v.tolist(),
            "quantiles": self.quantiles.tolist(),
            "bias": self.bias,
            "sd": self.sd,
            "samples": self.samples,
            "neighbour_correlation": self.correlation,
            "autocorrelation_samples": self.time,
            "independent_samples": self.independent,
        }


def residual_bands(results: StudyResults) -> dict[str, dict[str, ResidualBand]]:
    """Return the held-out residuals by terrain and model."""
    return {
        name: {
            model: band
            for model in RESIDUAL_MODELS
            if (band := residual_band(result, model)) is not None
        }
        for name, result in results.study.terrains.items()
    }


def residual_band(result: TerrainResult, model: str) -> ResidualBand | None:
    """Return the held-out residuals of a model; None without a fold of it."""
    residual = held_out_residual(result, model)
    if residual.size == 0:
        return None
    v = SampleTable.of(held_out_trials(result, model)).v_t
    edges = np.linspace(v.min(), v.max(), _BINS + 1)
    bin_index = np.clip(np.searchsorted(edges, v, "right") - 1, 0, _BINS - 1)
    full = [k for k in range(_BINS) if np.count_nonzero(bin_index == k) >= _FEWEST]
    return ResidualBand(
        v=np.array([0.5 * (edges[k] + edges[k + 1]) for k in full]),
        quantiles=np.array(
            [np.quantile(residual[bin_index == k], SHARES) for k in full]
        )
        .reshape(-1, len(SHARES))
        .T,
        bias=float(residual.mean()),
        sd=float(residual.std()),
        samples=residual.size,
        correlation=_neighbours(residual),
        time=correlation_samples(residual),
    )


def held_out_trials(result: TerrainResult, model: str) -> list[PreparedTrial]:
    """Return the trials that folds of the model were tested on, in fold order."""
    return [result.trials[k] for k, _ in result.left_out(model)]


def held_out_residual(result: TerrainResult, model: str) -> Array:
    """Return measured minus predicted F_t [N] of all held-out trials, shape (n,)."""
    residuals = [
        trial.F_t - fold.model.mean(trial.F_n, trial.v_t, trial.further)
        for k, fold in result.left_out(model)
        for trial in [result.trials[k]]
    ]
    return np.concatenate([np.zeros(0), *residuals])


def explained_share(result: TerrainResult, model: str) -> float | None:
    """Return R^2 on held-out trials."""
    residual = held_out_residual(result, model)
    F_t = SampleTable.of(held_out_trials(result, model)).F_t
    power = float(((F_t - F_t.mean()) ** 2).sum()) if F_t.size else 0.0
    return 1.0 - float((residual**2).sum()) / power if power else None


def _neighbours(residual: Array) -> float:
    """Return the lag-1 autocorrelation of values (n,); 0 if all are equal."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    return float(centred[1:] @ centred[:-1]) / power if power else 0.0


def independent_samples(results: StudyResults) -> ReportTable:
    """Return the table of effective numbers of independent samples."""
    rows = [
        (
            name,
            TITLES[model],
            str(band.samples),
            f"{band.correlation:.3f}",
            f"{band.time:.0f}",
            f"{band.independent:.0f}",
        )
        for name, bands in results.of(residual_bands).items()
        for model, band in bands.items()
    ]
    return ReportTable(
        name="Independent samples",
        header=(
            "terrain",
            "model",
            "kept samples",
            "lag-1 autocorrelation",
            "autocorrelation time [samples]",
            "independent samples",
        ),
        rows=rows,
        note="Residuals, measured minus predicted force, of held-out trials. "
        "Independent: kept samples over the integrated autocorrelation time, summed "
        "until the correlation falls below 0.05. Standard errors in this report "
        "therefore count trials, never samples.",
        section=ReportSection.BEYOND,
    )


def draw_residuals(results: StudyResults) -> Figure | None:
    """Draw quantiles of measured minus predicted F_t over velocity."""
    shown = {name: bands for name, bands in results.of(residual_bands).items() if bands}
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 1.6)
    for ax, (name, bands) in zip(axes, shown.items(), strict=True):
        ax.axhline(0.0, color="#808080", lw=0.6)
        for k, model in enumerate(RESIDUAL_MODELS):
            if model not in bands:
                continue
            band, colour = bands[model], (FIRST_COLOUR, SECOND_COLOUR)[k]
            low, middle, high = band.quantiles
            style = ("-", "--")[k]
            ax.plot(band.v, middle, style, color=colour, lw=1.6, label=TITLES[model])
            for edge in (low, high):
                ax.plot(band.v, edge, style, color=colour, lw=0.8)
        ax.set_title(plain(results.study.terrains[name].title), loc="left")
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel("measured − predicted $F_t$ [N]", fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


def caption_residuals(results: StudyResults) -> str:
    """State bias and spread of the residuals."""
    values = [
        f"{name} {bands[GP_SE].bias:+z.2f} ± {bands[GP_SE].sd:.2f} N"
        for name, bands in results.of(residual_bands).items()
        if GP_SE in bands
    ]
    return (
        "Median (thick), 5 and 95 % quantiles (thin) of measured minus predicted force "
        "on held-out trials, in ten bins of velocity."
        + (
            f" Mean and standard deviation, GP (SE): {'; '.join(values)}."
            if values
            else ""
        )
    )


RESIDUALS_FIGURE = FigureSpec(
    "residuals",
    "Residuals",
    "Quantiles of measured minus predicted force over slip velocity for Tustin and "
    "Gaussian process, one panel per terrain.",
    draw_residuals,
    caption_residuals,
)
