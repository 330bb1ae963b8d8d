"""Coverage of velocity and load by the samples."""

import numpy as np

from analysis.data.quality import ENOUGH, coverage, thinnest
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.style import (
    COLOUR_MAP,
    MAP_ROW,
    Figure,
    log_norm,
    name_load_axes,
    panel_grid,
    plain,
)


def draw_coverage(results: StudyResults) -> Figure | None:
    """Draw the number of samples in every cell of velocity and load."""
    if not results.coverage:
        return None
    figure, axes = panel_grid(len(results.coverage), MAP_ROW)
    most = max(float(cells.counts.max()) for cells in results.coverage)
    norm = log_norm(1.0, max(most, 2.0))
    for ax, cells in zip(axes, results.coverage, strict=True):
        counts = np.ma.masked_less(cells.counts, 1.0)
        ax.pcolormesh(
            results.edges.v_t, results.edges.F_n, counts, norm=norm, cmap=COLOUR_MAP
        )
        ax.set_title(plain(results.study.terrains[cells.terrain].title), loc="left")
        ax.grid(visible=False)
    name_load_axes(figure)
    figure.colorbar(
        axes[0].collections[0], ax=axes, label="kept samples per cell", pad=0.01
    )
    return figure


def caption_coverage(results: StudyResults) -> str:
    """State the samples outside the map and where a terrain has few samples."""
    outside = sum(cells.outside for cells in results.coverage)
    total = outside + sum(float(cells.counts.sum()) for cells in results.coverage)
    thin = [
        f"{name} {words}"
        for name, result in results.study.terrains.items()
        if (words := thinnest(coverage(result.trials)))
    ]
    listed = f" Below {ENOUGH:.0%} of its samples: {'; '.join(thin)}." if thin else ""
    return (
        f"Samples available to the models; white cells hold none. {outside} of "
        f"{total:.0f} samples lie beyond the load axis.{listed}"
    )


COVERAGE_FIGURE = FigureSpec(
    "coverage",
    "Coverage of velocity and load",
    "Number of kept samples in cells of slip velocity and normal force, one panel "
    "per terrain, logarithmic colours.",
    draw_coverage,
    caption_coverage,
)
