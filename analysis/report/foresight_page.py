"""The figure of foresight on the page of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.figures.sections import ReportSection
from analysis.foresight.curves import ForesightCurves, ForesightExcerpt
from analysis.foresight.watching import HORIZON
from analysis.report.page_model import ReportFigure

if TYPE_CHECKING:  # a page that is not drawn anew needs no matplotlib
    from analysis.figures.style import Axes, Figure

FORESIGHT_KEY = "foresight"

_HEIGHT = 4.6  # inches
_STYLES = ("-", "--", "-.", ":")
_SPEED, _RISK = "#4d4d4d", "#0072B2"


def foresight_figure(
    curves: ForesightCurves, *, is_simulated: bool, with_pdf: bool = False
) -> ReportFigure | None:
    """Return the figure of foresight on held-out trials; None without numbers for it.

    Args:
        curves: what it shows.
        is_simulated: the trials were.
        with_pdf: it is wanted as PDF, too.
    """
    from analysis.figures.style import render, styled

    with styled():
        drawn = draw_foresight(curves)
        if drawn is None:
            return None
        picture = render(FORESIGHT_KEY, drawn, is_simulated, with_pdf=with_pdf)
    return ReportFigure(
        section=ReportSection.BEYOND,
        title="Foresight on held-out trials",
        alt="Probability of a slip and velocity over time; share of slips in alarm "
        "over the time before them; probability foreseen against share seen; "
        "probability of the true surface over the time slid.",
        caption=_caption(curves),
        picture=picture,
    )


def _caption(curves: ForesightCurves) -> str:
    """State what each panel shows, with its number."""
    parts = ["By models that have not seen the trial."]
    if curves.excerpt is not None:
        early = float(np.interp(0.1, curves.leads, curves.warned))
        parts.append(
            "Above: the stretch with the most slips; an alarm begins where the "
            "probability rises above the threshold. Share of slips in alarm: the alarm "
            f"stands 0.1 s before {early:.0%} of the slips."
        )
    if np.isfinite(curves.foreseen).all():
        off = float(np.abs(curves.foreseen - curves.seen).mean())
        parts.append(
            "Probability foreseen against share seen: ten bins of equally many ticks "
            f"at risk; mean difference {off:.3f}."
        )
    if curves.grounds:
        parts.append(
            "Probability of the true surface: mean part that it, flat or rocky, has of "
            "the probabilities of all known terrains."
        )
    return " ".join(parts)


def draw_foresight(curves: ForesightCurves) -> Figure | None:
    """Return a stretch of a trial, warning times, reliability and known ground.

    Panels without numbers are left out; None where there is none.
    """
    from analysis.figures.style import new_figure

    panels = [
        draw
        for draw, values in (
            (_draw_leads, curves.warned),
            (_draw_reliability, curves.foreseen),
            (_draw_grounds, np.array(list(curves.grounds.values()))),
        )
        if np.isfinite(values).any()
    ]
    if not panels:
        return None
    has_excerpt = curves.excerpt is not None
    figure = new_figure(_HEIGHT if has_excerpt else 0.5 * _HEIGHT)
    grid = figure.add_gridspec(1 + has_excerpt, len(panels))
    if curves.excerpt is not None:
        _draw_excerpt(figure.add_subplot(grid[0, :]), curves.excerpt)
    for k, draw in enumerate(panels):
        draw(figure.add_subplot(grid[-1, k]), curves)
    return figure


def _draw_excerpt(ax: Axes, excerpt: ForesightExcerpt) -> None:
    from analysis.figures.style import SPEED_LABEL, plain

    ax.plot(excerpt.t, excerpt.p, color=_RISK, lw=1.2, label="slip within 0.2 s")
    ax.axhline(excerpt.threshold, color=_RISK, lw=0.8, ls=":", label="alarm")
    for k, onset in enumerate(excerpt.onsets):
        label = "slip begins" if k == 0 else None
        ax.axvline(onset, color="#D55E00", lw=1.0, ls="--", label=label)
    ax.set(ylim=(0.0, 1.0), xlabel="time [s]", ylabel="probability")
    ax.set_xlim(0.0, float(excerpt.t[-1]))
    ax.set_title(plain(excerpt.title), loc="left")
    speed = ax.twinx()
    speed.plot(excerpt.t, excerpt.v_t, color=_SPEED, lw=0.9, label="slip velocity")
    speed.set_ylabel(SPEED_LABEL)
    speed.grid(visible=False)
    speed.spines["right"].set_visible(True)
    lines = [*ax.get_lines()[:3], *speed.get_lines()]
    speed.legend(handles=lines, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0))


def _draw_leads(ax: Axes, curves: ForesightCurves) -> None:
    ax.plot(1e3 * curves.leads, curves.warned, color=_RISK, lw=1.4)
    ax.axvline(1e3 * HORIZON, color="#808080", lw=0.8, ls=":")
    ax.set(ylim=(0.0, 1.0), xlim=(0.0, 1e3 * float(curves.leads[-1])))
    ax.set(xlabel="time before the slip [ms]", ylabel="share of slips in alarm")


def _draw_reliability(ax: Axes, curves: ForesightCurves) -> None:
    known = np.concatenate([curves.foreseen, curves.seen])
    top = 1.1 * float(np.nanmax(known, initial=0.1))
    ax.plot([0.0, top], [0.0, top], color="#808080", lw=0.8, ls=":")
    ax.plot(curves.foreseen, curves.seen, "o-", color=_RISK, ms=3.5, lw=1.0)
    ax.set(xlim=(0.0, top), ylim=(0.0, top))
    ax.set(xlabel="probability foreseen", ylabel="share seen")


def _draw_grounds(ax: Axes, curves: ForesightCurves) -> None:
    from analysis.figures.style import MODEL_COLOURS, plain

    for k, (name, means) in enumerate(curves.grounds.items()):
        style = _STYLES[(k // len(MODEL_COLOURS) + k) % len(_STYLES)]
        colour = MODEL_COLOURS[k % len(MODEL_COLOURS)]
        ax.plot(curves.slid, means, style, color=colour, lw=1.2, label=plain(name))
    ax.set(ylim=(0.0, 1.02), xlim=(0.0, float(curves.slid[-1])))
    ax.set(xlabel="time slid [s]", ylabel="probability of the true surface")
    ax.legend(loc="lower right", ncols=2, fontsize=6.5)
