"""Stick-slip: force over the displacement of the sole."""

import numpy as np

from analysis.data.prepare import Smoothed
from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.selection import representatives
from analysis.report.style import (
    FORCE_LABEL,
    ONE_COLUMN,
    WIDTH,
    Figure,
    new_figure,
    plain,
    shade_slip,
)
from analysis.study.terrain_fit import TerrainResult


def draw_stick_slip(results: StudyResults) -> Figure | None:
    """Draw force over displacement of one trial per kind of terrain."""
    chosen = representatives(results.study)
    if not chosen:
        return None
    figure = new_figure(
        1.35 * len(chosen) + 0.6, ONE_COLUMN if len(chosen) == 1 else WIDTH
    )
    axes = figure.subplots(len(chosen), 1, sharex=True, sharey=True, squeeze=False)
    for ax, result in zip(axes[:, 0], chosen, strict=True):
        number = most_slips(result)
        smooth = result.trials[number].smooth
        travel = travel_of(smooth)
        for k, slip in enumerate(result.slips[number]):
            start, stop = np.interp((slip.onset, slip.end), smooth.t, travel)
            shade_slip(ax, 1e3 * start, 1e3 * stop, is_named=k == 0)
        ax.plot(1e3 * travel, smooth.F_t, color="#0072B2", lw=0.8)
        ax.set_title(f"{plain(result.title)}, trial {number + 1}", loc="left")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper right")
    axes[-1, 0].set_xlabel("displacement of the sole [mm]")
    figure.supylabel(FORCE_LABEL, fontsize=8)
    return figure


def caption_stick_slip(results: StudyResults) -> str:
    """State number and length of the slips."""
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


def travel_of(smooth: Smoothed) -> Array:
    """Return the travel of the sole since the start [m], shape (n,) (trapezoidal)."""
    steps = 0.5 * (smooth.v_t[1:] + smooth.v_t[:-1]) * np.diff(smooth.t)
    return np.concatenate([[0.0], np.cumsum(steps)])


def most_slips(result: TerrainResult) -> int:
    """Return the index of the first trial with the most slips."""
    counts = [len(slips) for slips in result.slips]
    return counts.index(max(counts))


STICK_SLIP_FIGURE = FigureSpec(
    "stick_slip",
    "Stick-slip: force over displacement",
    "Traction force over the displacement of the sole for one trial per class of "
    "terrain; slips are shaded.",
    draw_stick_slip,
    caption_stick_slip,
    is_vector=True,
)
