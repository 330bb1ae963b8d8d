"""How honest the models are: coverage of their bands, chosen noise, residuals."""

import numpy as np

from analysis.figures.spec import FigureSpec
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
)
from analysis.findings.findings import RESIDUAL_MODELS, StudyResults
from analysis.findings.new_trial_bands import BINS
from analysis.study.metrics import standard_error
from analysis.study.models import GP_SE, TITLES
from analysis.study.terrain_fit import TerrainResult, mean_of

BANDS = (("coverage50", 0.50), ("coverage90", 0.90), ("coverage95", 0.95))
_FIRST, _SECOND = "#0072B2", "#D55E00"
_ROW = 0.32  # inches of one terrain's gain


def draw_calibration(results: StudyResults) -> Figure | None:
    """Return the share of held-out samples inside the 50, 90 and 95 % bands."""
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
    """State how far the bands are from their nominal coverage."""
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


def draw_noise(results: StudyResults) -> Figure | None:
    """Return what the chosen noise gains in log density, and what was chosen."""
    if not results.noise:
        return None
    count = len(results.noise)
    figure = new_figure(_ROW * count + 0.7, ONE_COLUMN)
    ax = figure.subplots()
    ax.axvline(0.0, color="#808080", lw=0.8)
    gains = [-summary.paired.difference for summary in results.noise]
    errors = [summary.paired.standard_error or 0.0 for summary in results.noise]
    ax.errorbar(
        gains, range(count), xerr=errors, fmt="o", ms=4, capsize=2.5, color=_FIRST
    )
    for k, summary in enumerate(results.noise):
        chosen = [f"{name} {n}" for name, n in summary.counts.items() if n]
        numbers = f"{summary.before:.3f} to {summary.after:.3f} nat"
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
    ax.set_yticks(range(count), [plain(summary.terrain) for summary in results.noise])
    ax.set_xlabel("gain in log density by chosen noise [nat]")
    ax.grid(visible=False, axis="y")
    return figure


def caption_noise(results: StudyResults) -> str:
    """State where input-dependent noise helps."""
    better = [
        f"{s.terrain} {-s.paired.difference:.3f} (p = {s.paired.p:.2g})"
        for s in results.noise
        if s.paired.difference < 0
    ]
    return (
        "Constant noise against noise chosen among the training trials of each fold: "
        "constant, log-linear in F_n and v_t, or that with heavy tails (Student's t). "
        "On the right: how many folds chose what, and NLPD before and after on trials "
        "left out; whiskers: standard error over trials. "
        + (f"Gain: {', '.join(better)}." if better else "No gain in this study.")
    )


def draw_shares(results: StudyResults) -> Figure | None:
    """Return where held-out samples lie in what is predicted for a new trial."""
    if not results.shares:
        return None
    figure, axes = panel_grid(len(results.shares), 1.4)
    edges = np.linspace(0.0, 1.0, BINS + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    for ax, shares in zip(axes, results.shares, strict=True):
        ax.axhline(1.0, color="black", lw=1.0, ls=(0, (4, 2)))
        ax.stairs(shares.density, edges, fill=True, color="#56B4E9", alpha=0.6)
        ax.errorbar(
            middles, shares.density, shares.error, fmt="none", color=_FIRST, lw=0.9
        )
        ax.set_ylim(0.0, 2.2)
        ax.set_xlim(0.0, 1.0)
        title = results.study.terrains[shares.terrain].title
        ax.set_title(plain(title), loc="left")
    figure.supxlabel("share of the predicted distribution below the sample", fontsize=8)
    figure.supylabel("density of held-out samples", fontsize=8)
    return figure


def caption_shares(results: StudyResults) -> str:
    """State how far the shares are from even, in standard errors."""
    values = [
        f"{shares.terrain} {np.abs(shares.density - 1.0).max():.2f}"
        for shares in results.shares
    ]
    return (
        "Probability integral transform: the share of the distribution predicted for a "
        "new trial that lies below a sample of a trial left out, in ten bins; dashed: "
        "uniform, as for a calibrated distribution. High ends: bands too narrow; "
        "a slope: a bias. Mean over trials, whiskers: standard error over trials. "
        f"Largest deviation from uniform: {'; '.join(values)}."
    )


def draw_residuals(results: StudyResults) -> Figure | None:
    """Return quantiles of measured minus predicted F_t over velocity."""
    shown = {name: bands for name, bands in results.residuals.items() if bands}
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
        for name, bands in results.residuals.items()
        if GP_SE in bands
    ]
    return (
        "Median (thick), 5 and 95 % quantiles (thin) of measured minus predicted force "
        "on trials left out, in ten bins of velocity."
        + (
            f" Mean and standard deviation, GP (SE): {'; '.join(values)}."
            if values
            else ""
        )
    )


def coverage_of(result: TerrainResult, model: str, key: str) -> float:
    """Return the mean over trials of a coverage; NaN where there is none."""
    value = mean_of(result.scores(model, key))
    return float("nan") if value is None else value


def _has(model: str):  # noqa: ANN202
    return lambda result: bool(result.models(model))


FIGURES = (
    FigureSpec(
        "calibration",
        "Calibration: coverage of the predictive bands",
        "Share of held-out samples inside the 50, 90 and 95 percent band for every "
        "terrain and model, with the nominal coverage as a dashed line.",
        draw_calibration,
        caption_calibration,
    ),
    FigureSpec(
        "noise",
        "Input-dependent noise",
        "Gain in log predictive density by chosen noise for every terrain with its "
        "standard error, and the number of folds per choice.",
        draw_noise,
        caption_noise,
    ),
    FigureSpec(
        "shares",
        "Calibration: probability integral transform of a new trial",
        "Histogram of the share of the predicted distribution below every held-out "
        "sample with its standard error over trials, one panel per terrain.",
        draw_shares,
        caption_shares,
    ),
    FigureSpec(
        "residuals",
        "Residuals",
        "Quantiles of measured minus predicted force over slip velocity for Tustin and "
        "Gaussian process, one panel per terrain.",
        draw_residuals,
        caption_residuals,
    ),
)
