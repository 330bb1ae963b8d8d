"""Repeatability of the trials of a terrain, and trends over the trials."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import Axes, Figure, panel_grid, plain
from analysis.report.traction_ratio import trial_ratio
from analysis.study.terrain_fit import TerrainResult

MEAN_FORCE, TRACTION_RATIO, MEAN_LOAD = "F_t", "F_t/F_n", "F_n"
TREND_UNITS = {MEAN_FORCE: "N", TRACTION_RATIO: "1", MEAN_LOAD: "N"}
SIGNIFICANT = 2.0  # standard errors that a significant slope exceeds


@dataclass(frozen=True, slots=True)
class Trend:
    """Linear trend of the trial means.

    Attributes:
        trials: numbers of the trials with kept samples, from 1, shape (n,).
        means: mean of every trial, shape (n,).
        slope: change per trial; None with fewer than three trials.
        slope_error: standard error of the slope.
        start: value of the line at trial 0; the overall mean without a slope.
    """

    trials: Array
    means: Array
    slope: float | None
    slope_error: float | None
    start: float

    @property
    def spread(self) -> float | None:
        """Standard deviation of the trial means (repeatability); None for one trial."""
        return float(self.means.std(ddof=1)) if self.means.size > 1 else None

    @property
    def is_significant(self) -> bool:
        """Whether the slope exceeds two of its standard errors."""
        if self.slope is None or self.slope_error is None:
            return False
        return abs(self.slope) > SIGNIFICANT * self.slope_error

    def numbers(self) -> dict[str, Any]:
        """Return the trend as plain values for fits.json."""
        return {
            "trials": self.trials.astype(int).tolist(),
            "means": self.means.tolist(),
            "slope": self.slope,
            "slope_error": self.slope_error,
            "spread": self.spread,
        }


def study_trends(results: StudyResults) -> dict[str, dict[str, Trend]]:
    """Fit the trends of the trial means by terrain and measure."""
    terrains = results.study.terrains
    return {name: trends_of(result) for name, result in terrains.items()}


def trends_of(result: TerrainResult) -> dict[str, Trend]:
    """Fit the trends of mean F_t, mean F_n and their ratio over the trials."""
    kept = [(k + 1, trial) for k, trial in enumerate(result.trials) if trial.kept]
    return {name: _trend(kept, measure) for name, measure in _MEASURES.items()}


def fit_trend(trials: Array, means: Array) -> Trend:
    """Fit a least-squares line to `means` over `trials`, each of shape (n,).

    The standard error of the slope is s / sqrt(sum (k - mean k)^2), with s^2 from the
    residuals with n - 2 degrees of freedom.
    """
    if means.size < 3:
        start = float(means.mean()) if means.size else float("nan")
        return Trend(trials, means, None, None, start)
    centred = trials - trials.mean()
    width = float(centred @ centred)
    slope = float(centred @ means) / width
    start = float(means.mean()) - slope * float(trials.mean())
    residual = means - start - slope * trials
    variance = float(residual @ residual) / (means.size - 2)
    return Trend(trials, means, slope, float(np.sqrt(variance / width)), start)


def _trend(
    kept: Sequence[tuple[int, PreparedTrial]], measure: Callable[[PreparedTrial], float]
) -> Trend:
    numbers = np.array([float(number) for number, _ in kept])
    return fit_trend(numbers, np.array([measure(trial) for _, trial in kept]))


_MEASURES: Mapping[str, Callable[[PreparedTrial], float]] = {
    MEAN_FORCE: lambda trial: float(trial.F_t.mean()),
    MEAN_LOAD: lambda trial: float(trial.F_n.mean()),
    TRACTION_RATIO: trial_ratio,
}


def trend_table(results: StudyResults) -> ReportTable:
    """Return the table of repeatability and trend of every terrain."""
    rows = []
    for name, trends in results.of(study_trends).items():
        force, load, ratio = (
            trends[key] for key in (MEAN_FORCE, MEAN_LOAD, TRACTION_RATIO)
        )
        if force.means.size < 2:
            continue
        rows.append(
            [
                name,
                str(force.means.size),
                f"{force.means.mean():.2f} ± {force.spread:.2f}",
                slope_cell(force),
                f"{ratio.means.mean():.2f} ± {ratio.spread:.2f}",
                slope_cell(ratio),
                f"{load.means.mean():.2f} ± {load.spread:.2f}",
            ]
        )
    return ReportTable(
        name="Repeatability and trend over trials",
        header=(
            "terrain",
            "trials",
            "F_t [N]",
            "F_t per trial [N]",
            "F_t/F_n",
            "F_t/F_n per trial",
            "F_n [N]",
        ),
        rows=rows,
        note="Means of the trials ± their standard deviation; slopes ± standard error. "
        "A slope of more than two standard errors points to wear of the terrain.",
        section=ReportSection.BEYOND,
    )


def slope_cell(trend: Trend) -> str:
    """Format a slope with its standard error; – without a slope."""
    if trend.slope is None or trend.slope_error is None:
        return "–"
    return f"{trend.slope:+z.3f} ± {trend.slope_error:.3f}"


def draw_trends(results: StudyResults) -> Figure | None:
    """Draw the mean F_t of every trial with the trend line."""
    shown = {
        name: trends[MEAN_FORCE]
        for name, trends in results.of(study_trends).items()
        if trends[MEAN_FORCE].means.size
    }
    if not shown:
        return None
    figure, axes = panel_grid(len(shown), 1.6)
    for ax, (name, trend) in zip(axes, shown.items(), strict=True):
        _draw_trend(ax, trend)
        ax.set_title(plain(results.study.terrains[name].title), loc="left")
    means = np.concatenate([trend.means for trend in shown.values()])
    low, high = min(0.0, float(means.min())), float(means.max())
    axes[0].set_ylim(low, high + 0.25 * (high - low or 1.0))  # space for the text
    most = int(max(float(trend.trials.max()) for trend in shown.values()))
    axes[0].set_xlim(0.4, most + 0.6)
    axes[0].set_xticks(range(1, most + 1, 1 + most // 6))
    figure.supxlabel("trial", fontsize=8)
    figure.supylabel("mean traction of a trial [N]", fontsize=8)
    return figure


def caption_trends(results: StudyResults) -> str:
    """State which terrains have a significant trend."""
    changing = [
        f"{name} ({trend.slope:+z.3f} ± {trend.slope_error:.3f} N per trial)"
        for name, trends in results.of(study_trends).items()
        if (trend := trends[MEAN_FORCE]).is_significant
    ]
    return (
        "Mean over the kept samples of each trial, in the order of recording; dashed: "
        "least-squares line, its slope with standard error. "
        + (
            f"More than two standard errors: {', '.join(changing)}. With ten trials, "
            "about one terrain in thirteen shows such a slope by chance."
            if changing
            else "No slope exceeds two standard errors: no wear is detected."
        )
    )


def _draw_trend(ax: Axes, trend: Trend) -> None:
    ax.plot(trend.trials, trend.means, "o", ms=3.2, color="#0072B2")
    if trend.slope is None or trend.slope_error is None:
        return
    ends = np.array([trend.trials.min(), trend.trials.max()])
    ax.plot(ends, trend.start + trend.slope * ends, "--", color="#D55E00", lw=1.3)
    text = f"{trend.slope:+z.3f} ± {trend.slope_error:.3f} N per trial"
    text = text.replace("-", "−")
    ax.text(
        0.03,
        0.97,
        plain(text),
        transform=ax.transAxes,
        va="top",
        fontsize=6.5,
        fontweight="bold" if trend.is_significant else "normal",
    )


TRENDS_FIGURE = FigureSpec(
    "trends",
    "Trend over trials",
    "Mean traction of every trial in order, with a straight line per terrain.",
    draw_trends,
    caption_trends,
)
