"""Fig. 2: the Tustin model with its fitted parameters."""

import numpy as np

from analysis.data.prepare import PrepareOptions
from analysis.data.samples import SampleTable
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.selection import representatives
from analysis.report.style import (
    FORCE_LABEL,
    SPEED_LABEL,
    Axes,
    Figure,
    panel_grid,
    plain,
)
from analysis.study.terrain_fit import TerrainResult


def draw_tustin_model(results: StudyResults) -> Figure | None:
    """Draw Fig. 2: the fitted curve of one terrain per kind, with its parameters."""
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
    """State the flags of the fits."""
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


FIG2 = FigureSpec(
    "fig2_tustin_model",
    "Fig. 2 The Tustin model with its fitted parameters",
    "The fitted Tustin curve over slip velocity with its asymptote, the static "
    "force and the Stribeck velocity, one panel per class of terrain.",
    draw_tustin_model,
    caption_tustin_model,
)
