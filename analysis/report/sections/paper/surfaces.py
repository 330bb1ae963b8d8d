"""Fig. 7 and 8: the Gaussian process over velocity and load.

All panels share their axes and their colours.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.selection import representatives
from analysis.report.style import (
    COLOUR_MAP,
    MAP_ROW,
    Axes,
    Figure,
    LogNorm,
    log_norm,
    name_load_axes,
    panel_grid,
    plain,
)
from analysis.report.surfaces import Surface, common_range

_WIDE = 0.7  # decades above which a logarithmic scale has logarithmic ticks
_MOST_DIGITS = 15
_LEVELS = 14  # contour levels
_MOST_DOTS = 400  # samples shown per panel
_VEIL = 0.65  # opacity of the veil over cells without nearby samples


def draw_mean(results: StudyResults) -> Figure | None:
    """Draw Fig. 7: mean of the Gaussian process over (v_t, F_n)."""
    if not results.surfaces:
        return None
    low, high = common_range([surface.mean for surface in results.surfaces])
    levels = np.linspace(low, high if high > low else low + 1.0, _LEVELS)
    means = [surface.mean for surface in results.surfaces]
    return _draw(results, means, levels, "mean of $F_t$ [N]")


def caption_mean(results: StudyResults) -> str:
    """State the range of the means."""
    values = [
        f"{surface.terrain} {surface.mean.min():.1f} to {surface.mean.max():.1f} N"
        for surface in _representative(results)
    ]
    return (
        "First fold of each terrain, the same colours everywhere; dots are samples. "
        "Faded: no sample within a cell of the coverage map, the process reverts to "
        f"its prior mean there. {'; '.join(values)}.{_below_zero(results)}"
    )


def _below_zero(results: StudyResults) -> str:
    """State the terrains with a negative mean; empty for none."""
    lowest = [s.terrain for s in results.surfaces if float(s.mean.min()) < 0.0]
    if not lowest:
        return ""
    return (
        f" The mean falls below zero on {', '.join(lowest)}: the process does not "
        "constrain the force to be positive."
    )


def draw_variance(results: StudyResults) -> Figure | None:
    """Draw Fig. 8: predictive variance with noise, on a logarithmic colour scale."""
    if not results.surfaces:
        return None
    low, high = common_range([surface.variance for surface in results.surfaces])
    low = max(low, 1e-9)
    levels = np.geomspace(low, max(high, 1.01 * low), _LEVELS)
    variances = [np.maximum(surface.variance, low) for surface in results.surfaces]
    norm = log_norm(levels[0], levels[-1])
    return _draw(results, variances, levels, "variance of $F_t$ [N²]", norm=norm)


def caption_variance(results: StudyResults) -> str:
    """State the variances of one terrain per kind."""
    values = [
        f"{surface.terrain} {float(np.median(surface.variance)):.2g} N²"
        for surface in _representative(results)
    ]
    return (
        "Variance of a measurement, noise included; logarithmic colours, faded where "
        "no sample is near. Medians over "
        f"the map: {'; '.join(values)}."
    )


def distinct_labels(values: Sequence[float]) -> list[str]:
    """Format distinct numbers with the fewest digits (at least two) that differ."""
    for digits in range(2, _MOST_DIGITS):
        texts = [f"{value:.{digits}g}" for value in values]
        if len(set(texts)) == len(set(values)):
            return texts
    return [repr(float(value)) for value in values]


def round_ticks(low: float, high: float, *, is_log: bool) -> list[float]:
    """Return a few round tick values from `low` to `high`.

    Both ends if there are fewer than two.
    """
    span = np.log10(high / low) if is_log else 0.0
    if is_log and span > _WIDE:
        digits = (1.0,) if span > 3.0 else (1.0, 3.0) if span > 1.5 else (1.0, 2.0, 5.0)
        decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
        ticks = [digit * 10.0**decade for decade in decades for digit in digits]
    else:
        step = (high - low) / 6.0
        power = 10.0 ** np.floor(np.log10(step))
        step = power * next(k for k in (1.0, 2.0, 2.5, 5.0, 10.0) if k * power >= step)
        first = int(np.ceil(low / step))
        ticks = [k * step for k in range(first, int(np.floor(high / step)) + 1)]
    inside = [float(f"{tick:.6g}") for tick in ticks if low <= tick <= high]
    return inside if len(inside) > 1 else [low, high]


def _draw(
    results: StudyResults,
    values: Sequence[Array],
    levels: Array,
    label: str,
    norm: LogNorm | None = None,
) -> Figure:
    figure, axes = panel_grid(len(values), MAP_ROW)
    for ax, surface, value in zip(axes, results.surfaces, values, strict=True):
        ax.contourf(
            results.axes.v_t,
            results.axes.F_n,
            value,
            levels,
            cmap=COLOUR_MAP,
            norm=norm,
        )
        _fade(ax, results, surface.terrain)
        _dot(ax, surface)
        ax.set_title(plain(results.study.terrains[surface.terrain].title), loc="left")
        ax.grid(visible=False)
    axes[0].set_xlim(results.axes.v_t[0], results.axes.v_t[-1])
    axes[0].set_ylim(results.axes.F_n[0], results.axes.F_n[-1])
    name_load_axes(figure)
    ticks = round_ticks(float(levels[0]), float(levels[-1]), is_log=norm is not None)
    bar = figure.colorbar(
        axes[0].collections[0], ax=axes, label=label, pad=0.01, ticks=ticks
    )
    bar.ax.minorticks_off()
    bar.ax.set_yticks(ticks, distinct_labels(ticks))
    return figure


def _fade(ax: Axes, results: StudyResults, terrain: str) -> None:
    """Fade cells further than one cell from every sample."""
    cells = next(c for c in results.coverage if c.terrain == terrain)
    veil = np.ma.masked_where(near_samples(cells.counts), np.ones(cells.counts.shape))
    ax.pcolormesh(
        results.edges.v_t,
        results.edges.F_n,
        veil,
        cmap="binary_r",
        vmin=0.0,
        vmax=1.0,
        alpha=_VEIL,
        lw=0,
    )


def near_samples(counts: Array) -> NDArray[np.bool_]:
    """Return which cells hold or touch a sample, shape of `counts`."""
    rows, columns = counts.shape
    padded = np.pad(counts > 0, 1)
    shifted = [
        padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)
    ]
    return np.logical_or.reduce(shifted)


def _dot(ax: Axes, surface: Surface) -> None:
    """Mark the samples; beyond them the model extrapolates."""
    step = max(1, surface.data.count // _MOST_DOTS)
    ax.plot(
        surface.data.v_t[::step],
        surface.data.F_n[::step],
        ".",
        ms=1.6,
        mew=0,
        color="white",
        alpha=0.6,
    )


def _representative(results: StudyResults) -> list[Surface]:
    """Return the surfaces of one terrain per kind."""
    names = {result.terrain for result in representatives(results.study)}
    return [surface for surface in results.surfaces if surface.terrain in names]


FIG7 = FigureSpec(
    "fig7_gp_mean",
    "Fig. 7 Mean of the Gaussian process over velocity and load",
    "Filled contours of predicted traction force over slip velocity and normal "
    "force, one panel per terrain, with the samples as dots.",
    draw_mean,
    caption_mean,
)

FIG8 = FigureSpec(
    "fig8_gp_variance",
    "Fig. 8 Variance of the Gaussian process over velocity and load",
    "Filled contours of predictive variance over slip velocity and normal force, "
    "one panel per terrain; plates are far below stones.",
    draw_variance,
    caption_variance,
)
