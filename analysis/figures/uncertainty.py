"""How honest the models are: coverage of their bands, chosen noise, residuals."""

import numpy as np

from analysis.figures.style import (
    MODEL_COLOURS,
    MODEL_MARKERS,
    ONE_COLUMN,
    SPEED_LABEL,
    Figure,
    name_ticks,
    new_figure,
    panel_grid,
    plain,
    titled,
)
from analysis.findings.findings import RESIDUAL_MODELS, StudyResults
from analysis.study.models import TITLES
from analysis.study.study import TerrainResult, mean_of

BANDS = (("coverage50", 0.50), ("coverage90", 0.90), ("coverage95", 0.95))
_FIRST, _SECOND = "#0072B2", "#D55E00"
_ROW = 0.32  # inches of one terrain's gain


def draw_calibration(found: StudyResults) -> Figure | None:
    """Return the share of held-out samples inside the 50, 90 and 95 % bands."""
    results = [r for r in found.study.terrains.values() if r.folds]
    models = [m for m in found.study.options.fit.models if any(map(_has(m), results))]
    if not models:
        return None
    figure = new_figure(4.6)
    axes = figure.subplots(len(BANDS), 1, sharex=True)
    width = 0.7 / len(models)
    for ax, (key, nominal) in zip(axes, BANDS, strict=True):
        ax.axhline(nominal, color="black", lw=1.0, ls=(0, (4, 2)))
        for k, model in enumerate(models):
            place = np.arange(len(results)) + (k - (len(models) - 1) / 2) * width
            ax.plot(
                place,
                [coverage_of(result, model, key) for result in results],
                MODEL_MARKERS[k % len(MODEL_MARKERS)],
                color=MODEL_COLOURS[k % len(MODEL_COLOURS)],
                ms=4.5,
                label=TITLES[model],
            )
        ax.set_ylabel(f"inside {nominal:.0%} band")
        ax.set_ylim(max(0.0, nominal - 0.3), min(1.02, nominal + 0.3))
        ax.grid(visible=False, axis="x")
    name_ticks(axes[-1], [result.terrain for result in results])
    axes[-1].set_xlabel("terrain")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def coverage_of(result: TerrainResult, model: str, key: str) -> float:
    """Return the mean over trials of a coverage; NaN where there is none."""
    value = mean_of(result.scores(model, key))
    return float("nan") if value is None else value


def draw_noise(found: StudyResults) -> Figure | None:
    """Return what the chosen noise gains in log density, and what was chosen."""
    if not found.noise:
        return None
    count = len(found.noise)
    figure = new_figure(_ROW * count + 0.7, ONE_COLUMN)
    ax = figure.subplots()
    ax.axvline(0.0, color="#808080", lw=0.8)
    gains = [-summary.paired.difference for summary in found.noise]
    errors = [summary.paired.standard_error or 0.0 for summary in found.noise]
    ax.errorbar(
        gains, range(count), xerr=errors, fmt="o", ms=4, capsize=2.5, color=_FIRST
    )
    for k, summary in enumerate(found.noise):
        chosen = [f"{name} {n}" for name, n in summary.counts.items() if n]
        numbers = f"{summary.before:.3f} to {summary.after:.3f} log N"
        ax.annotate(
            "\n".join([", ".join(chosen), numbers]),
            (1.0, k),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=6.5,
        )
    ax.set_ylim(count - 0.5, -0.5)
    ax.set_yticks(range(count), [plain(summary.terrain) for summary in found.noise])
    ax.set_xlabel("gain in log density by chosen noise [log N]")
    ax.grid(visible=False, axis="y")
    return figure


def draw_residuals(found: StudyResults) -> Figure | None:
    """Return quantiles of measured minus predicted F_t over velocity."""
    shown = {name: bands for name, bands in found.residuals.items() if bands}
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 1.6)
    for ax, (name, bands) in zip(axes, shown.items(), strict=True):
        ax.axhline(0.0, color="#808080", lw=0.6)
        for k, model in enumerate(RESIDUAL_MODELS):
            if model not in bands:
                continue
            band, colour = bands[model], (_FIRST, _SECOND)[k]
            low, middle, high = band.quantiles
            style = ("-", "--")[k]
            ax.plot(band.v, middle, style, color=colour, lw=1.6, label=TITLES[model])
            for edge in (low, high):
                ax.plot(band.v, edge, style, color=colour, lw=0.8)
        ax.set_title(titled(name), loc="left")
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel("measured − predicted $F_t$ [N]", fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


def _has(model: str):  # noqa: ANN202
    return lambda result: bool(result.models(model))
