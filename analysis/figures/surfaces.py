"""Figures 7 and 8 and the coverage map: what lies over velocity and load.

All panels share their axes and their colours.
"""

from collections.abc import Sequence

import numpy as np

from analysis.data.series import Array
from analysis.figures.style import (
    LOAD_LABEL,
    SPEED_LABEL,
    Axes,
    Figure,
    LogNorm,
    panel_grid,
    titled,
)
from analysis.findings.findings import StudyResults
from analysis.findings.surfaces import Surface, common_range

_MOST_DIGITS = 15
_LEVELS = 14  # contours
_MOST_DOTS = 400  # samples shown per panel
_ROW = 1.75  # inches
_MAP = "cividis"  # the same to every kind of colour sight


def draw_mean(found: StudyResults) -> Figure | None:
    """Return Fig. 7: the mean of the Gaussian process over (v_t, F_n)."""
    if not found.surfaces:
        return None
    low, high = common_range([surface.mean for surface in found.surfaces])
    levels = np.linspace(low, high if high > low else low + 1.0, _LEVELS)
    means = [surface.mean for surface in found.surfaces]
    return _draw(found, means, levels, "mean of $F_t$ [N]")


def draw_variance(found: StudyResults) -> Figure | None:
    """Return Fig. 8: its variance with the noise, colours on a logarithmic scale."""
    if not found.surfaces:
        return None
    low, high = common_range([surface.variance for surface in found.surfaces])
    low = max(low, 1e-9)
    levels = np.geomspace(low, max(high, 1.01 * low), _LEVELS)
    variances = [np.maximum(surface.variance, low) for surface in found.surfaces]
    norm = LogNorm(levels[0], levels[-1])
    return _draw(found, variances, levels, "variance of $F_t$ [N²]", norm=norm)


def draw_coverage(found: StudyResults) -> Figure | None:
    """Return how many samples lie in every cell of velocity and load."""
    if not found.coverage:
        return None
    figure, axes = panel_grid(len(found.coverage), _ROW)
    most = max(float(part.counts.max()) for part in found.coverage)
    norm = LogNorm(1.0, max(most, 2.0))
    for ax, part in zip(axes, found.coverage, strict=True):
        counts = np.ma.masked_less(part.counts, 1.0)
        ax.pcolormesh(found.edges.v_t, found.edges.F_n, counts, norm=norm, cmap=_MAP)
        ax.set_title(titled(part.terrain), loc="left")
        ax.grid(visible=False)
    _name_axes(figure)
    figure.colorbar(
        axes[0].collections[0], ax=axes, label="kept samples per cell", pad=0.01
    )
    return figure


def _draw(
    found: StudyResults,
    values: Sequence[Array],
    levels: Array,
    label: str,
    norm: LogNorm | None = None,
) -> Figure:
    figure, axes = panel_grid(len(values), _ROW)
    for ax, surface, value in zip(axes, found.surfaces, values, strict=True):
        ax.contourf(found.axes.v_t, found.axes.F_n, value, levels, cmap=_MAP, norm=norm)
        _dot(ax, surface)
        ax.set_title(titled(surface.terrain), loc="left")
        ax.grid(visible=False)
    axes[0].set_xlim(found.axes.v_t[0], found.axes.v_t[-1])
    axes[0].set_ylim(found.axes.F_n[0], found.axes.F_n[-1])
    _name_axes(figure)
    ticks = levels[:: max(1, _LEVELS // 6)]
    bar = figure.colorbar(
        axes[0].collections[0], ax=axes, label=label, pad=0.01, ticks=ticks
    )
    bar.ax.minorticks_off()
    bar.ax.set_yticks(ticks, told_apart(ticks.tolist()))
    return figure


def told_apart(values: Sequence[float]) -> list[str]:
    """Return different numbers in so few digits, two at least, that all differ."""
    for digits in range(2, _MOST_DIGITS):
        texts = [f"{value:.{digits}g}" for value in values]
        if len(set(texts)) == len(set(values)):
            return texts
    return [repr(float(value)) for value in values]


def _dot(ax: Axes, surface: Surface) -> None:
    """Show where the samples lie: beyond them a model only guesses."""
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


def _name_axes(figure: Figure) -> None:
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel(LOAD_LABEL, fontsize=8)
