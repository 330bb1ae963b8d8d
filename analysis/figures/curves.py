"""Figures 4 to 6: force and velocity over time, and the models over velocity.

All panels of a figure share their axes, so that terrains can be compared by eye.
"""

from collections.abc import Callable

from analysis.figures.selection import Panel, TimeWindow, excerpts, force_range, panels
from analysis.figures.style import (
    FORCE_LABEL,
    LOAD_LINES,
    SPEED_LABEL,
    Axes,
    Figure,
    new_figure,
    panel_grid,
    titled,
)
from analysis.study.models import GP_SE, TUSTIN
from analysis.study.study import Study


def draw_excerpts(study: Study) -> Figure | None:
    """Return Fig. 4: F_t and v_t over time, slips marked, one excerpt per class."""
    chosen = excerpts(study)
    if not chosen:
        return None
    figure = new_figure(3.6)
    axes = figure.subplots(2, len(chosen), sharex=True, sharey="row", squeeze=False)
    for column, excerpt in enumerate(chosen):
        _draw_excerpt(axes[0, column], axes[1, column], excerpt)
    axes[0, 0].set_ylabel(FORCE_LABEL)
    axes[1, 0].set_ylabel("velocity $v_t$ [m/s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def draw_tustin(study: Study) -> Figure | None:
    """Return Fig. 5: Tustin curves at low, median and high F_n, with the samples."""
    return _draw_panels(panels(study, TUSTIN), _draw_curves)


def draw_gp(study: Study) -> Figure | None:
    """Return Fig. 6: GP mean and 2 sigma at the median F_n, with the samples."""
    return _draw_panels(panels(study, GP_SE), _draw_band)


def _draw_excerpt(above: Axes, below: Axes, excerpt: TimeWindow) -> None:
    for k, (slip, onset, end) in enumerate(excerpt.slips):
        for ax in (above, below):
            ax.axvspan(
                onset,
                end,
                color="#F0E442",
                alpha=0.55,
                lw=0,
                label="slip" if k == 0 else None,
            )
            if slip.has_bounce:
                ax.axvline(end, color="#CC79A7", lw=1.0, ls=":")
    bounced = [end for slip, _, end in excerpt.slips if slip.has_bounce]
    if bounced:
        above.axvline(
            bounced[0], color="#CC79A7", lw=1.0, ls=":", label="bounce-back follows"
        )
    above.plot(excerpt.t, excerpt.F_t, color="#0072B2", lw=0.9)
    below.plot(excerpt.t, excerpt.v_t, color="#D55E00", lw=0.9)
    below.axhline(0.0, color="#808080", lw=0.6)
    below.set_xlabel("time [s]")
    above.set_title(f"{titled(excerpt.terrain)}, trial {excerpt.trial}", loc="left")


def _draw_panels(
    chosen: list[Panel], draw: Callable[[Axes, Panel], None]
) -> Figure | None:
    if not chosen:
        return None
    figure, axes = panel_grid(len(chosen), 2.1)
    for ax, panel in zip(axes, chosen, strict=True):
        draw(ax, panel)
        ax.set_title(titled(panel.terrain), loc="left")
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
        mine = nearest == k
        ax.plot(
            panel.data.v_t[mine],
            panel.data.F_t[mine],
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
