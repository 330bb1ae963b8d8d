"""Fig. 4: traction force and velocity over time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.data.events import Slip, find_slips
from analysis.data.prepare import PreparedTrial, Smoothed
from analysis.data.series import Array
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.selection import representatives
from analysis.report.style import (
    FORCE_LABEL,
    Axes,
    Figure,
    mark_simulated,
    new_figure,
    plain,
    shade_slip,
    styled,
)
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

WINDOW = 3.5  # s, length of an excerpt
_STEP = 0.1  # s between candidate windows
_ENOUGH_BOUNCES = 2
_BEFORE, _AFTER = 0.3, 0.6  # s around a slip that a window must include


@dataclass(frozen=True, slots=True)
class TimeWindow:
    """Excerpt of one trial.

    Attributes:
        title: title of the terrain, with the kind.
        terrain: name of the terrain.
        trial: number of the trial, from 1.
        t: time from the start of the window [s], shape (n,).
        v_t: smoothed velocity [m/s], shape (n,).
        F_t: smoothed traction force [N], shape (n,).
        slips: slips inside, with times from the start of the window.
    """

    title: str
    terrain: str
    trial: int
    t: Array
    v_t: Array
    F_t: Array
    slips: tuple[Slip, ...]


def time_windows(study: Study) -> list[TimeWindow]:
    """Choose an excerpt of one terrain per kind."""
    return [busiest_window(result) for result in representatives(study)]


def busiest_window(result: TerrainResult) -> TimeWindow:
    """Choose the excerpt with the most bounce-backs, then slips, then motion.

    At most two bounce-backs count, as in the paper's figure.
    """
    candidates = [
        (_events_and_motion(trial.smooth, slips, start), k, start)
        for k, (trial, slips) in enumerate(
            zip(result.trials, result.slips, strict=True)
        )
        for start in _starts(trial.smooth)
    ]
    _, k, start = max(candidates)
    smooth = result.trials[k].smooth
    rows = (smooth.t >= start) & (smooth.t <= start + WINDOW)
    return TimeWindow(
        title=result.title,
        terrain=result.terrain,
        trial=k + 1,
        t=smooth.t[rows] - start,
        v_t=smooth.v_t[rows],
        F_t=smooth.F_t[rows],
        slips=tuple(
            replace(slip, onset=slip.onset - start, end=slip.end - start)
            for slip in result.slips[k]
            if _is_inside(slip, start)
        ),
    )


def _starts(smooth: Smoothed) -> Array:
    """Return candidate starts, one step apart, where there are samples."""
    first = float(smooth.t[0])
    last = max(float(smooth.t[-1]) - WINDOW, first)
    starts = first + np.unique(np.floor((smooth.t - first) / _STEP)) * _STEP
    return starts[starts < last + _STEP / 2]


def _is_inside(slip: Slip, start: float) -> bool:
    return start + _BEFORE <= slip.onset and slip.end + _AFTER <= start + WINDOW


def _events_and_motion(
    smooth: Smoothed, slips: Sequence[Slip], start: float
) -> tuple[int, int, float]:
    inside = [slip for slip in slips if _is_inside(slip, start)]
    rows = slice(*np.searchsorted(smooth.t, [start, start + WINDOW]))
    moving = float(np.mean(smooth.v_t[rows] > 0)) if rows.stop > rows.start else 0.0
    bounced = sum(slip.has_bounce for slip in inside)
    return min(bounced, _ENOUGH_BOUNCES), len(inside), moving


def draw_excerpts(results: StudyResults) -> Figure | None:
    """Draw Fig. 4: F_t and v_t over time, slips marked, one excerpt per kind."""
    chosen = time_windows(results.study)
    if not chosen:
        return None
    figure = new_figure(3.6)
    axes = figure.subplots(2, len(chosen), sharex=True, sharey="row", squeeze=False)
    for column, window in enumerate(chosen):
        _draw_window(axes[0, column], axes[1, column], window)
        axes[0, column].set_title(
            f"{plain(window.title)}, trial {window.trial}", loc="left"
        )
    _label(figure, axes[0, 0], axes[1, 0])
    return figure


def plot_trial(trial: PreparedTrial, *, is_simulated: bool) -> Figure:
    """Plot F_t and v_t of a whole trial over time in the style of Fig. 4."""
    smooth = trial.smooth
    start = float(smooth.t[0])
    whole = TimeWindow(
        title=trial.terrain,
        terrain=trial.terrain,
        trial=1,
        t=smooth.t - start,
        v_t=smooth.v_t,
        F_t=smooth.F_t,
        slips=tuple(
            replace(slip, onset=slip.onset - start, end=slip.end - start)
            for slip in find_slips(smooth)
        ),
    )
    with styled():
        figure = new_figure(3.6)
        above, below = figure.subplots(2, 1, sharex=True)
        _draw_window(above, below, whole)
        above.set_title(plain(f"{trial.name} on {trial.terrain}"), loc="left")
        _label(figure, above, below)
        if is_simulated:
            mark_simulated(figure)
    return figure


def _label(figure: Figure, above: Axes, below: Axes) -> None:
    above.set_ylabel(FORCE_LABEL)
    below.set_ylabel("velocity $v_t$ [m/s]")
    handles, labels = above.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=2)


def caption_excerpts(results: StudyResults) -> str:
    """State slips and forces of the excerpts in Fig. 4."""
    parts = [_describe_window(window) for window in time_windows(results.study)]
    return "Smoothed record at the full rate. " + " ".join(parts)


def _draw_window(above: Axes, below: Axes, window: TimeWindow) -> None:
    for k, slip in enumerate(window.slips):
        for ax in (above, below):
            shade_slip(ax, slip.onset, slip.end, is_named=k == 0)
            if slip.has_bounce:
                ax.axvline(slip.end, color="#CC79A7", lw=1.0, ls=":")
    bounced = [slip.end for slip in window.slips if slip.has_bounce]
    if bounced:
        above.axvline(
            bounced[0], color="#CC79A7", lw=1.0, ls=":", label="bounce-back follows"
        )
    above.plot(window.t, window.F_t, color="#0072B2", lw=0.9)
    below.plot(window.t, window.v_t, color="#D55E00", lw=0.9)
    below.axhline(0.0, color="#808080", lw=0.6)
    below.set_xlabel("time [s]")


def _describe_window(window: TimeWindow) -> str:
    where = f"{window.terrain}, trial {window.trial}"
    slips = window.slips
    if not slips:
        low, middle, high = np.quantile(window.F_t, (0.05, 0.5, 0.95))
        return (
            f"{where}: no slip; F_t near {middle:.1f} N, nine tenths of it between "
            f"{low:.1f} and {high:.1f} N."
        )
    peak = np.median([slip.peak for slip in slips])
    floor = np.median([slip.floor for slip in slips])
    bounced = sum(slip.has_bounce for slip in slips)
    return (
        f"{where}: {_count(len(slips), 'slip')}, F_t falling from {peak:.1f} N before "
        f"to {floor:.1f} N during one (medians); bounce-back after "
        f"{bounced}."
    )


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


FIG4 = FigureSpec(
    "fig4_excerpts",
    "Fig. 4 Traction force and velocity over time",
    "Traction force above and velocity below over a few seconds of one trial per "
    "class of terrain; slips are shaded.",
    draw_excerpts,
    caption_excerpts,
    is_vector=True,
)
