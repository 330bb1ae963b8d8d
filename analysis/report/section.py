"""What the sections of a report are made of: their headings, tables and figures.

A figure is drawn from `StudyResults`; what else a page holds, as tables of sessions,
joins the section that it names.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from analysis.report.results import StudyResults
from analysis.report.style import Figure


class ReportSection(Enum):
    """A section of the report; the value is its heading, the order that of the page."""

    SUMMARY = "Summary"
    CHANGED = "Sensitivity to analysis choices"
    PAPER = "The paper's table and figures"
    BEYOND = "Beyond the paper"
    HEALTH = "Rig health"
    REACH = "Measurement limits"
    IMPORTED = "Imported"
    ORIGIN = "Analysis settings and provenance"

    @property
    def anchor(self) -> str:
        """Name of the section in links."""
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table of the report.

    Attributes:
        name: its heading.
        header: names of the columns, with units.
        rows: cells as text, each row as long as the header.
        note: a remark below it; empty for none.
        section: where it stands.
    """

    name: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    section: ReportSection = ReportSection.ORIGIN


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """A figure of the report.

    Attributes:
        key: name of its files, e.g. "fig4_excerpts".
        title: its name, after the paper's figure where there is one.
        alt: what the picture shows, for those who cannot see it.
        draw: draws it; None where there are no numbers for it.
        caption: states what is seen in it, with numbers.
        is_vector: the page shows it as SVG, to be enlarged and read.
    """

    key: str
    title: str
    alt: str
    draw: Callable[[StudyResults], Figure | None]
    caption: Callable[[StudyResults], str]
    is_vector: bool = False
