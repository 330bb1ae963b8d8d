"""Figures 2, 5 and 6: the models over velocity.

All panels of a figure share their axes, so that terrains can be compared by eye.
"""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.data.prepare import PrepareOptions
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.figures.sections import ReportSection
from analysis.figures.selection import Panel, force_range, panels, representatives
from analysis.figures.spec import FigureSpec
from analysis.figures.style import (
    FORCE_LABEL,
    LOAD_LINES,
    SPEED_LABEL,
    Axes,
    Figure,
    panel_grid,
    plain,
)
from analysis.findings.findings import StudyResults
from analysis.study.models import GP_SE, GP_SE_TRIAL, TUSTIN
from analysis.study.terrain_fit import TerrainResult


def draw_tustin_model(results: StudyResults) -> Figure | None:
    """Return Fig. 2: the fitted curve of one terrain per kind, its parameters named."""
    chosen = [r for r in representatives(results.study) if r.whole.fit is not None]
    if not chosen:
        return None
    figure, axes = panel_grid(len(chosen), 2.3)
    for ax, result in zip(axes, chosen, strict=True):
        _draw_model(ax, result, results.study.options.prepare)
        ax.set_title(plain(result.title), loc="left")
    axes[0].set_ylim(bottom=min(0.0, axes[0].get_ylim()[0]))
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel(FORCE_LABEL, fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def caption_tustin_model(results: StudyResults) -> str:
    """State the fits that are drawn."""
    values = [
        f"{result.terrain}: {'; '.join(fit.flags) or 'no flag'}"
        for result in representatives(results.study)
        if (fit := result.whole.fit) is not None
    ]
    return (
        "Eq. (1) with the fit of all trials at the median F_n, from standstill to the "
        "end of the window; thin below the window, where there are no "
        "samples. F_s at standstill; the asymptote μF_n + b v_t; v_s where "
        f"the Stribeck term has fallen to 1/e. Flags of the fits - {'. '.join(values)}."
    )


def _draw_model(ax: Axes, result: TerrainResult, window: PrepareOptions) -> None:
    fit = result.whole.fit
    if fit is None:
        return
    p, load = fit.parameters, float(np.median(SampleTable.of(result.trials).F_n))
    v = np.concatenate([[0.0], np.geomspace(1e-5, window.fastest, 400)])
    asymptote = p.mu * load + p.b * v
    static = p.F_s * load if fit.form.is_proportional else p.F_s
    curve = fit.mean(np.full(v.shape, load), v)
    is_seen = v >= window.slowest
    ax.plot(v[is_seen], curve[is_seen], color="#0072B2", lw=1.8, label="fitted curve")
    ax.plot(
        v[~is_seen],
        curve[~is_seen],
        color="#56B4E9",
        lw=1.0,
        label="fitted curve, no samples",
    )
    ax.plot(v, asymptote, "--", color="#D55E00", lw=1.0, label="$\\mu F_n + b\\,v_t$")
    ax.plot([0.0], [static], "o", color="#009E73", ms=4.5, label="$F_s$", clip_on=False)
    if p.v_s <= window.fastest:
        ax.axvline(p.v_s, color="#808080", lw=0.9, ls=":", label="$v_s$")
    ax.axhline(0.0, color="#808080", lw=0.6)
    text = (
        f"$\\mu$ = {p.mu:.3g}\n$F_s$ = {p.F_s:.3g} N\n$v_s$ = {p.v_s:.3g} m/s\n"
        f"$\\delta_s$ = {p.delta_s:.3g}\n$b$ = {p.b:.3g} kg/s\n$F_n$ = {load:.3g} N"
    )
    ax.text(
        0.97, 0.97, text, transform=ax.transAxes, ha="right", va="top", fontsize=6.5
    )


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
        + _bands_below_zero(panels(results.study, GP_SE))
    )


def _bands_below_zero(chosen: Sequence[Panel]) -> str:
    """Return which bands go below zero, and how many samples do; empty for none."""
    parts = [
        f"{panel.terrain} ({float(np.mean(panel.data.F_t < 0.0)):.1%} of the samples)"
        for panel in chosen
        if float((panel.means[1] - 2 * panel.sds[1]).min()) < 0.0
    ]
    if not parts:
        return ""
    return (
        " A normal band is symmetric, although traction is rarely "
        f"negative: it goes below zero (dotted line) on {', '.join(parts)}."
    )


def draw_new_trial(results: StudyResults) -> Figure | None:
    """Return the band that holds 90 % of a new trial, with the samples."""
    return _draw_panels(panels(results.study, GP_SE_TRIAL), _draw_quantiles)


def caption_new_trial(results: StudyResults) -> str:
    """State how far the bands of a new trial reach from the median."""
    reach = [
        f"{low:.2f} N below and {high:.2f} N above on {panel.terrain}"
        for panel in _one_per_kind(panels(results.study, GP_SE_TRIAL))
        for low, high in [np.median(np.diff(panel.band, axis=0), axis=1)]
    ]
    return (
        "First fold of each terrain: median and the 5 to 95% band of "
        f"a new trial, at the median F_n. It reaches {'; '.join(reach)}."
    )


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
    _note_loads(ax, panel.loads)


def _draw_quantiles(ax: Axes, panel: Panel) -> None:
    _draw_samples(ax, panel)
    low, middle, high = panel.band
    ax.fill_between(
        panel.v, low, high, color="#56B4E9", alpha=0.4, lw=0, label="5 to 95%"
    )
    ax.plot(panel.v, middle, color="#0072B2", lw=1.8, label="median")
    _note_loads(ax, panel.loads[1:2])


def _draw_band(ax: Axes, panel: Panel) -> None:
    _draw_samples(ax, panel)
    mean, sd = panel.means[1], panel.sds[1]
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
    _note_loads(ax, panel.loads)


def _draw_samples(ax: Axes, panel: Panel) -> None:
    ax.axhline(0.0, color="black", lw=0.7, ls=":")
    style = {"ms": 2.4, "color": "#808080", "alpha": 0.3, "mew": 0}
    ax.plot(panel.data.v_t, panel.data.F_t, ".", label="samples", **style)


def _note_loads(ax: Axes, drawn: Array) -> None:
    loads = " / ".join(f"{load:.1f}" for load in drawn)
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


FIGURES = (
    FigureSpec(
        "fig2_tustin_model",
        "Fig. 2 The Tustin model with its fitted parameters",
        "The fitted Tustin curve over slip velocity with its asymptote, the static "
        "force and the Stribeck velocity, one panel per class of terrain.",
        draw_tustin_model,
        caption_tustin_model,
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
    FigureSpec(
        "new_trial",
        "Predictive bands of a new trial",
        "Samples of traction force over slip velocity with the median and the band "
        "that holds 90 percent of a new trial, one panel per terrain.",
        draw_new_trial,
        caption_new_trial,
    ),
)
