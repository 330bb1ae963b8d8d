"""Calibration of the predicted uncertainties: scores, and coverage of the bands."""

import numpy as np

from analysis.report.cell_texts import with_error
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import (
    MODEL_COLOURS,
    MODEL_MARKERS,
    Figure,
    name_ticks,
    new_figure,
)
from analysis.study.metrics import standard_error
from analysis.study.models import TITLES
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult, mean_of

_SHOWN = ("rmse", "nlpd", "crps", "coverage50", "coverage90", "coverage95", "variance")
_HEADS = (
    "RMSE [N]",
    "NLPD [nat]",
    "CRPS [N]",
    "inside 50% band",
    "90%",
    "95%",
    "variance [N²]",
)
BANDS = (("coverage50", 0.50), ("coverage90", 0.90), ("coverage95", 0.95))


def uncertainty_table(study: Study) -> ReportTable:
    """Return the table of probabilistic scores and band coverage."""
    rows = [
        [name, TITLES[model], *_cells(result, model)]
        for name, result in study.terrains.items()
        for model in study.options.fit.models
        if result.models(model)
    ]
    return ReportTable(
        name="Predicted uncertainty",
        header=("terrain", "model", *_HEADS),
        rows=rows,
        note="Means over the held-out trials ± standard error over trials, not over "
        "samples. NLPD: negative log density; CRPS: continuous ranked probability "
        "score; both reward a calibrated spread, smaller is better. A band whose "
        "coverage is far below its nominal share is too narrow. The variance is that "
        "of a measurement, noise included.",
        section=ReportSection.BEYOND,
    )


def _cells(result: TerrainResult, model: str) -> list[str]:
    return [
        with_error(
            result.scores(model, key), ".1%" if key.startswith("coverage") else ".3f"
        )
        for key in _SHOWN
    ]


def draw_calibration(results: StudyResults) -> Figure | None:
    """Draw the share of held-out samples inside the 50, 90 and 95 % bands."""
    terrains = [r for r in results.study.terrains.values() if r.folds]
    models = [
        m for m in results.study.options.fit.models if any(map(_has(m), terrains))
    ]
    if not models:
        return None
    figure = new_figure(4.6)
    axes = figure.subplots(len(BANDS), 1, sharex=True)
    width = 0.7 / len(models)
    for ax, (key, nominal) in zip(axes, BANDS, strict=True):
        ax.axhline(nominal, color="black", lw=1.0, ls=(0, (4, 2)))
        for k, model in enumerate(models):
            x = np.arange(len(terrains)) + (k - (len(models) - 1) / 2) * width
            ax.errorbar(
                x,
                [coverage_of(result, model, key) for result in terrains],
                yerr=[standard_error(r.scores(model, key)) or 0.0 for r in terrains],
                fmt=MODEL_MARKERS[k % len(MODEL_MARKERS)],
                color=MODEL_COLOURS[k % len(MODEL_COLOURS)],
                ms=4.5,
                elinewidth=0.7,
                label=TITLES[model],
            )
        ax.set_ylabel(f"inside {nominal:.0%} band")
        ax.set_ylim(max(0.0, nominal - 0.3), min(1.02, nominal + 0.3))
        ax.grid(visible=False, axis="x")
    name_ticks(axes[-1], [result.terrain for result in terrains])
    axes[-1].set_xlabel("terrain")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def caption_calibration(results: StudyResults) -> str:
    """State the range of coverage of each band."""
    shares = [
        (nominal, name, model, share)
        for key, nominal in BANDS
        for name, result in results.study.terrains.items()
        for model in results.study.options.fit.models
        if not np.isnan(share := coverage_of(result, model, key))
    ]
    parts = []
    for _, nominal in BANDS:
        of_band = [entry for entry in shares if entry[0] == nominal]
        low = min(of_band, key=lambda entry: entry[3])
        high = max(of_band, key=lambda entry: entry[3])
        parts.append(
            f"{nominal:.0%} band: {low[3]:.0%} ({low[1]}, {TITLES[low[2]]}) to "
            f"{high[3]:.0%} ({high[1]}, {TITLES[high[2]]})"
        )
    return (
        "Coverage: share of held-out samples inside the central band, mean over "
        "trials; dashed: nominal coverage; whiskers: standard error over trials. "
        f"{'; '.join(parts)}."
    )


def coverage_of(result: TerrainResult, model: str, key: str) -> float:
    """Return the mean of a coverage over trials; NaN if there is none."""
    value = mean_of(result.scores(model, key))
    return float("nan") if value is None else value


def _has(model: str):  # noqa: ANN202
    return lambda result: bool(result.models(model))


CALIBRATION_FIGURE = FigureSpec(
    "calibration",
    "Calibration: coverage of the predictive bands",
    "Share of held-out samples inside the 50, 90 and 95 percent band for every "
    "terrain and model, with the nominal coverage as a dashed line.",
    draw_calibration,
    caption_calibration,
)
