"""A figure of the report as one value: what draws it and everything said about it."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from analysis.figures.style import Figure
from analysis.findings.findings import StudyResults


class ReportSection(Enum):
    """A section of the report; the value is its heading, the order that of the page."""

    SUMMARY = "Summary"
    CHANGED = "Under another choice"
    PAPER = "The paper's table and figures"
    BEYOND = "Beyond the paper"
    HEALTH = "Rig health"
    REACH = "What this rig could have seen"
    ORIGIN = "Choices and provenance"

    @property
    def anchor(self) -> str:
        """Name of the section in links."""
        return self.name.lower()


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
    """

    key: str
    title: str
    alt: str
    draw: Callable[[StudyResults], Figure | None]
    caption: Callable[[StudyResults], str]
    section: ReportSection = ReportSection.BEYOND
