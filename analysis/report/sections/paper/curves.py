"""Fig. 5 and 6: Tustin and Gaussian process models over velocity."""

from collections.abc import Sequence

import numpy as np

from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec
from analysis.report.style import Figure
from analysis.report.velocity_panels import (
    Panel,
    describe_curve,
    draw_band,
    draw_curves,
    draw_panels,
    one_per_kind,
    panels,
)
from analysis.study.models import GP_SE, TUSTIN


def draw_tustin(results: StudyResults) -> Figure | None:
    """Draw Fig. 5: Tustin curves at low, median and high F_n, with the samples."""
    return draw_panels(panels(results.study, TUSTIN), draw_curves)


def caption_tustin(results: StudyResults) -> str:
    """State the end points of the Tustin curves."""
    values = [
        describe_curve(panel) for panel in one_per_kind(panels(results.study, TUSTIN))
    ]
    fold = "each terrain's first fold, one coherent fit and not the medians of Table I"
    return f"Curves of {fold}. At the median load {'; '.join(values)}."


def draw_gp(results: StudyResults) -> Figure | None:
    """Draw Fig. 6: GP mean and 2 sigma at the median F_n, with the samples."""
    return draw_panels(panels(results.study, GP_SE), draw_band)


def caption_gp(results: StudyResults) -> str:
    """State the width of the bands of the processes."""
    values = [
        f"{2 * float(np.median(panel.sds[1])):.2f} N on {panel.terrain}"
        for panel in one_per_kind(panels(results.study, GP_SE))
    ]
    return (
        "First fold of each terrain. The band of two standard deviations, noise "
        f"included, reaches {', '.join(values)} to either side of the mean."
        + _bands_below_zero(panels(results.study, GP_SE))
    )


def _bands_below_zero(chosen: Sequence[Panel]) -> str:
    """State which bands and how many samples are below zero; empty for none."""
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


FIG5 = FigureSpec(
    "fig5_tustin",
    "Fig. 5 Tustin models",
    "Samples of traction force over slip velocity with the Tustin curve at low, "
    "median and high normal force, one panel per terrain.",
    draw_tustin,
    caption_tustin,
)

FIG6 = FigureSpec(
    "fig6_gp",
    "Fig. 6 Gaussian process models",
    "Samples of traction force over slip velocity with the mean of the Gaussian "
    "process and a band of two standard deviations, one panel per terrain.",
    draw_gp,
    caption_gp,
)
