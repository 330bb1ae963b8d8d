"""The trials themselves: side by side, from first to last, and force over way."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.data.prepare import PreparedTrial, Smoothed
from analysis.data.series import Array
from analysis.data.terrain_kinds import kind_title
from analysis.figures.excerpts import shade_slip
from analysis.figures.selection import representatives
from analysis.figures.spec import FigureSpec
from analysis.figures.style import (
    FORCE_LABEL,
    ONE_COLUMN,
    WIDTH,
    Axes,
    Figure,
    mark_simulated,
    new_figure,
    panel_grid,
    plain,
    styled,
    terrain_colours,
)
from analysis.findings.findings import StudyResults
from analysis.findings.trends import MEAN_FORCE, Trend
from analysis.study.terrain_fit import TerrainResult

_MOST_TRIALS = 20  # side by side
_MOST_POINTS = 400  # of a curve
_GAP = 0.08  # of a cell between two trials


def draw_trials(results: StudyResults) -> Figure | None:
    """Return small multiples: F_t over the way of every trial, a row per terrain."""
    terrains = results.study.terrains
    trials = {name: result.trials for name, result in terrains.items()}
    titles = {name: result.title for name, result in terrains.items()}
    return _side_by_side(trials, titles, results.study.kinds)


def plot_trials(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str],
    *,
    is_simulated: bool,
) -> Figure:
    """Return F_t over the way of every trial side by side, as the report draws it.

    Args:
        trials: by terrain, at least one.
        kinds: "small", "big" or "flat" by terrain.
        is_simulated: marks the figure.
    """
    titles = {name: f"{name}: {kind_title(kinds[name])}" for name in trials}
    with styled():
        figure = _side_by_side(trials, titles, kinds)
        if is_simulated:
            mark_simulated(figure)
    return figure


def _side_by_side(
    trials: Mapping[str, Sequence[PreparedTrial]],
    titles: Mapping[str, str],
    kinds: Mapping[str, str],
) -> Figure:
    figure = new_figure(0.95 * len(trials) + 0.7)
    axes = figure.subplots(len(trials), 1, sharex=True, sharey=True, squeeze=False)
    most = min(max(map(len, trials.values())), _MOST_TRIALS)
    colours = terrain_colours(kinds)
    for ax, (terrain, group) in zip(axes[:, 0], trials.items(), strict=True):
        for k, trial in enumerate(group[:most]):
            way, force = _thinned(trial.smooth)
            reach = max(float(way.max()), 1e-9)
            ax.plot(
                k + 0.5 + _GAP + (1.0 - 2.0 * _GAP) * np.clip(way / reach, 0.0, 1.0),
                force,
                lw=0.6,
                color=colours[terrain],
            )
        ax.set_title(plain(titles[terrain]), loc="left", pad=2.0)
        ax.grid(visible=False, axis="x")
    lowest, highest = force_limits([t for group in trials.values() for t in group])
    axes[0, 0].set_ylim(lowest, highest)
    axes[0, 0].set_xlim(0.5, most + 0.5)
    axes[-1, 0].set_xticks(range(1, most + 1))
    axes[-1, 0].set_xlabel("trial, and in it the share of its way from 0 to 1")
    figure.supylabel(FORCE_LABEL, fontsize=8)
    return figure


def caption_trials(results: StudyResults) -> str:
    """State how many trials are shown."""
    count = sum(len(result.trials) for result in results.study.terrains.values())
    return (
        f"Smoothed traction of {count} trials, each from the far end to the near one; "
        "one scale for all terrains."
    )


def draw_trends(results: StudyResults) -> Figure | None:
    """Return the mean F_t of every trial with its line: wear of the terrain."""
    shown = {
        name: trends[MEAN_FORCE]
        for name, trends in results.trends.items()
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
    axes[0].set_ylim(low, high + 0.25 * (high - low or 1.0))  # room for the words
    most = int(max(float(trend.trials.max()) for trend in shown.values()))
    axes[0].set_xlim(0.4, most + 0.6)
    axes[0].set_xticks(range(1, most + 1, 1 + most // 6))
    figure.supxlabel("trial", fontsize=8)
    figure.supylabel("mean traction of a trial [N]", fontsize=8)
    return figure


def caption_trends(results: StudyResults) -> str:
    """State which terrains change from the first trial to the last."""
    changing = [
        f"{name} ({trend.slope:+z.3f} ± {trend.slope_error:.3f} N per trial)"
        for name, trends in results.trends.items()
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


def draw_stick_slip(results: StudyResults) -> Figure | None:
    """Return force over displacement of one trial per kind of terrain."""
    chosen = representatives(results.study)
    if not chosen:
        return None
    figure = new_figure(
        1.35 * len(chosen) + 0.6, ONE_COLUMN if len(chosen) == 1 else WIDTH
    )
    axes = figure.subplots(len(chosen), 1, sharex=True, sharey=True, squeeze=False)
    for ax, result in zip(axes[:, 0], chosen, strict=True):
        number = most_slips(result)
        smooth, way = result.trials[number].smooth, way_of(result.trials[number].smooth)
        for k, slip in enumerate(result.slips[number]):
            start, stop = np.interp((slip.onset, slip.end), smooth.t, way)
            shade_slip(ax, 1e3 * start, 1e3 * stop, is_named=k == 0)
        ax.plot(1e3 * way, smooth.F_t, color="#0072B2", lw=0.8)
        ax.set_title(f"{plain(result.title)}, trial {number + 1}", loc="left")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper right")
    axes[-1, 0].set_xlabel("displacement of the sole [mm]")
    figure.supylabel(FORCE_LABEL, fontsize=8)
    return figure


def caption_stick_slip(results: StudyResults) -> str:
    """State how long slips are."""
    values = []
    for result in representatives(results.study):
        slips = [slip.length for trial in result.slips for slip in trial]
        if slips:
            values.append(
                f"{result.terrain}: {len(slips)} slips, median "
                f"{1e3 * float(np.median(slips)):.0f} mm"
            )
        else:
            values.append(f"{result.terrain}: no slip")
    return (
        "The trial with most slips of one terrain per class: force rises over "
        f"millimetres and drops in a slip (shaded). {'; '.join(values)}."
    )


def way_of(smooth: Smoothed) -> Array:
    """Return the way of the sole since the start [m], shape (n,), by trapezia."""
    steps = 0.5 * (smooth.v_t[1:] + smooth.v_t[:-1]) * np.diff(smooth.t)
    return np.concatenate([[0.0], np.cumsum(steps)])


def most_slips(result: TerrainResult) -> int:
    """Return the number of the trial with most slips, from 0; the first of equals."""
    counts = [len(slips) for slips in result.slips]
    return counts.index(max(counts))


def force_limits(trials: Sequence[PreparedTrial]) -> tuple[float, float]:
    """Return limits of F_t [N] that hold all but a few spikes of all trials."""
    ends = [np.quantile(trial.smooth.F_t, (0.001, 0.999)) for trial in trials]
    low, high = min(float(e[0]) for e in ends), max(float(e[1]) for e in ends)
    margin = 0.04 * (high - low) or 1.0
    return low - margin, high + margin


def _thinned(smooth: Smoothed) -> tuple[Array, Array]:
    step = max(1, smooth.t.size // _MOST_POINTS)
    return way_of(smooth)[::step], smooth.F_t[::step]


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


FIGURES = (
    FigureSpec(
        "trials",
        "All trials",
        "Small curves of traction force over the way of each trial, one row per "
        "terrain.",
        draw_trials,
        caption_trials,
        is_vector=True,
    ),
    FigureSpec(
        "trends",
        "Trend over trials",
        "Mean traction of every trial in order, with a straight line per terrain.",
        draw_trends,
        caption_trends,
    ),
    FigureSpec(
        "stick_slip",
        "Stick-slip: force over displacement",
        "Traction force over the displacement of the sole for one trial per class of "
        "terrain; slips are shaded.",
        draw_stick_slip,
        caption_stick_slip,
        is_vector=True,
    ),
)
