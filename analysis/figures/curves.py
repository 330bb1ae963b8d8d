"""Figures 4 to 6: force and velocity over time, and the models over velocity.

All panels of a figure share their axes, so that terrains can be compared by eye.
"""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.figures.sections import ReportSection
from analysis.figures.selection import (
    Panel,
    TimeWindow,
    force_range,
    panels,
    time_windows,
)
from analysis.figures.spec import FigureSpec
from analysis.figures.style import (
    FORCE_LABEL,
    LOAD_LINES,
    SPEED_LABEL,
    Axes,
    Figure,
    new_figure,
    panel_grid,
    plain,
)
from analysis.findings import StudyResults
from analysis.study import GP_SE, TUSTIN


def draw_excerpts(results: StudyResults) -> Figure | None:
    """Return Fig. 4: F_t and v_t over time, slips marked, one excerpt per kind."""
    chosen = time_windows(results.study)
    if not chosen:
        return None
    figure = new_figure(3.6)
    axes = figure.subplots(2, len(chosen), sharex=True, sharey="row", squeeze=False)
    for column, window in enumerate(chosen):
        _draw_window(axes[0, column], axes[1, column], window)
    axes[0, 0].set_ylabel(FORCE_LABEL)
    axes[1, 0].set_ylabel("velocity $v_t$ [m/s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def caption_excerpts(results: StudyResults) -> str:
    """State slips and forces of the stretches in Fig. 4."""
    parts = [_describe_window(window) for window in time_windows(results.study)]
    return "Smoothed record at the full rate. " + " ".join(parts)


def draw_tustin(results: StudyResults) -> Figure | None:
    """Return Fig. 5: Tustin curves at low, median and high F_n, with the samples."""
    return _draw_panels(panels(results.study, TUSTIN), _draw_curves)


def caption_tustin(results: StudyResults) -> str:
    """State where the Tustin curves begin and end."""
    values = [
        _describe_curve(panel) for panel in _one_per_kind(panels(results.study, TUSTIN))
    ]
    fold = "each terrain's first fold, one coherent fit and not the medians of Table I"
    return f"Curves of {fold}. At the median load {'; '.join(values)}."


def draw_gp(results: StudyResults) -> Figure | None:
    """Return Fig. 6: GP mean and 2 sigma at the median F_n, with the samples."""
    return _draw_panels(panels(results.study, GP_SE), _draw_band)


def caption_gp(results: StudyResults) -> str:
    """State how wide the bands of the processes are."""
    values = [
        f"{2 * float(np.median(panel.sds[1])):.2f} N on {panel.terrain}"
        for panel in _one_per_kind(panels(results.study, GP_SE))
    ]
    return (
        "First fold of each terrain. The band of two standard deviations, noise "
        f"included, reaches {', '.join(values)} to either side of the mean."
    )


def _draw_window(above: Axes, below: Axes, window: TimeWindow) -> None:
    for k, slip in enumerate(window.slips):
        for ax in (above, below):
            ax.axvspan(
                slip.onset,
                slip.end,
                color="#F0E442",
                alpha=0.55,
                lw=0,
                label="slip" if k == 0 else None,
            )
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
    above.set_title(f"{plain(window.title)}, trial {window.trial}", loc="left")


def _draw_panels(
    chosen: list[Panel], draw: Callable[[Axes, Panel], None]
) -> Figure | None:
    if not chosen:
        return None
    figure, axes = panel_grid(len(chosen), 2.1)
    for ax, panel in zip(axes, chosen, strict=True):
        draw(ax, panel)
        ax.set_title(plain(panel.title), loc="left")
    axes[0].set_ylim(*force_range(chosen))
    axes[0].set_xlim(0.0, max(float(panel.v.max()) for panel in chosen))
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel(FORCE_LABEL, fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    columns = len(labels) if len(chosen) > 1 or len(labels) < 4 else 2
    figure.legend(
        handles, labels, loc="outside upper center", ncols=columns, markerscale=3
    )
    return figure


def _draw_curves(ax: Axes, panel: Panel) -> None:
    nearest = panel.nearest_load()
    for k, (_, colour, _) in enumerate(LOAD_LINES):
        is_nearest = nearest == k
        ax.plot(
            panel.data.v_t[is_nearest],
            panel.data.F_t[is_nearest],
            ".",
            ms=2.4,
            color=colour,
            alpha=0.35,
            mew=0,
        )
    for k, (name, colour, style) in enumerate(LOAD_LINES):
        label = f"{name} $F_n$"
        ax.plot(panel.v, panel.means[k], style, color=colour, lw=1.6, label=label)
    _note_loads(ax, panel)


def _draw_band(ax: Axes, panel: Panel) -> None:
    mean, sd = panel.means[1], panel.sds[1]
    ax.plot(
        panel.data.v_t,
        panel.data.F_t,
        ".",
        ms=2.4,
        color="#808080",
        alpha=0.3,
        mew=0,
        label="samples",
    )
    ax.fill_between(
        panel.v,
        mean - 2 * sd,
        mean + 2 * sd,
        color="#E69F00",
        alpha=0.35,
        lw=0,
        label=r"$\pm 2\sigma$ at median $F_n$",
    )
    for k, (name, colour, style) in enumerate(LOAD_LINES):
        width = 1.8 if k == 1 else 1.0
        label = f"mean, {name} $F_n$"
        ax.plot(panel.v, panel.means[k], style, color=colour, lw=width, label=label)
    _note_loads(ax, panel)


def _note_loads(ax: Axes, panel: Panel) -> None:
    loads = " / ".join(f"{load:.1f}" for load in panel.loads)
    ax.text(
        0.97,
        0.95,
        f"$F_n$ {loads} N",
        transform=ax.transAxes,
        ha="right",
        va="top",
        fontsize=7,
        bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 1.0},
    )


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
        f"to {floor:.1f} N during one (medians); the foot is thrown back after "
        f"{bounced}."
    )


def _describe_curve(panel: Panel) -> str:
    start, end = panel.means[1][[0, -1]]
    return (
        f"F_t goes from {start:.1f} N at {panel.v[0]:.3f} m/s to {end:.1f} N at "
        f"{panel.v[-1]:.3f} m/s on {panel.terrain}"
    )


def _one_per_kind(chosen: Sequence[Panel]) -> list[Panel]:
    first: dict[str, Panel] = {}
    for panel in chosen:
        first.setdefault(panel.kind, panel)
    return list(first.values())


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


FIGURES = (
    FigureSpec(
        "fig4_excerpts",
        "Fig. 4 Traction force and velocity over time",
        "Traction force above and velocity below over a few seconds of one trial per "
        "class of terrain; slips are shaded.",
        draw_excerpts,
        caption_excerpts,
        ReportSection.PAPER,
    ),
    FigureSpec(
        "fig5_tustin",
        "Fig. 5 Tustin models",
        "Samples of traction force over slip velocity with the Tustin curve at low, "
        "median and high normal force, one panel per terrain.",
        draw_tustin,
        caption_tustin,
        ReportSection.PAPER,
    ),
    FigureSpec(
        "fig6_gp",
        "Fig. 6 Gaussian process models",
        "Samples of traction force over slip velocity with the mean of the Gaussian "
        "process and a band of two standard deviations, one panel per terrain.",
        draw_gp,
        caption_gp,
        ReportSection.PAPER,
    ),
)
