"""A figure of the report as one value: its drawing and its texts."""

from collections.abc import Callable
from dataclasses import dataclass

from analysis.figures.sections import ReportSection
from analysis.figures.style import Figure
from analysis.findings.findings import StudyResults


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
