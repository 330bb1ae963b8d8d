"""The figure of foresight on the page of a study."""

import numpy as np

from analysis.figures import ReportSection, foresight, render, styled
from analysis.foresight import ForesightCurves
from analysis.report.page_model import ReportFigure

FORESIGHT_KEY = "foresight"


def foresight_figure(
    curves: ForesightCurves, *, is_simulated: bool, with_pdf: bool = False
) -> ReportFigure:
    """Return the figure of foresight on held-out trials.

    Args:
        curves: what it shows.
        is_simulated: the trials were.
        with_pdf: it is wanted as PDF, too.
    """
    with styled():
        picture = render(
            FORESIGHT_KEY,
            foresight.draw_foresight(curves),
            is_simulated,
            with_pdf=with_pdf,
        )
    return ReportFigure(
        section=ReportSection.BEYOND,
        title="Foresight on held-out trials",
        alt="Above: probability of a slip and velocity over time. Below: share of "
        "slips in alarm over the time before them, probability foreseen against share "
        "seen, probability of the true surface over the time slid.",
        caption=_caption(curves),
        picture=picture,
    )


def _caption(curves: ForesightCurves) -> str:
    parts = ["By models that have not seen the trial."]
    if curves.excerpt is not None:
        early = float(np.interp(0.1, curves.leads, curves.warned))
        parts.append(
            "Above: the stretch with the most slips; an alarm begins where the "
            "probability rises above the threshold. Below, left: the alarm stands "
            f"0.1 s before {early:.0%} of the slips."
        )
    if np.isfinite(curves.foreseen).all():
        off = float(np.abs(curves.foreseen - curves.seen).mean())
        parts.append(
            "Middle: ten bins of equally many ticks at risk; mean difference "
            f"{off:.3f}."
        )
    if curves.grounds:
        parts.append(
            "Right: mean part that the true surface, flat or rocky, has of the "
            "probabilities of all known terrains."
        )
    return " ".join(parts)
