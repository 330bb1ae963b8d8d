"""A figure of the report as one value: its drawing and its texts."""

from collections.abc import Callable
from dataclasses import dataclass

from analysis.figures.sections import ReportSection
from analysis.figures.style import Figure
from analysis.findings import StudyResults


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """A figure of the report.

    Attributes:
        key: name of its files, e.g. "fig4_excerpts".
        title: its name, after the paper's figure where there is one.
        alt: what the picture shows, for those who cannot see it.
        draw: draws it; None where there are no numbers for it.
        caption: states what is seen in it, with numbers.
        section: where it stands.
        is_vector: the page shows it as SVG, to be enlarged and read.
    """

    key: str
    title: str
    alt: str
    draw: Callable[[StudyResults], Figure | None]
    caption: Callable[[StudyResults], str]
    section: ReportSection = ReportSection.BEYOND
    is_vector: bool = False


PAGE_ORDER = (
    "fig2_tustin_model",
    "fig4_excerpts",
    "fig5_tustin",
    "fig6_gp",
    "fig7_gp_mean",
    "fig8_gp_variance",
    "fig9_errors",
    "fig10_cross_bars",
    "fig10_cross_map",
    "new_trial",
    "calibration",
    "shares",
    "noise",
    "break_away",
    "break_away_risk",
    "confusion_terrains",
    "confusion_stones",
    "confusion_surface",
    "coverage",
    "trials",
    "trends",
    "residuals",
    "stick_slip",
    "timing",
    "rig",
)
