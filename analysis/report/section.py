"""Building blocks of report sections: headings, tables and figures.

A figure is drawn from `StudyResults`; other content, such as tables of sessions, names
the section it belongs to.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from analysis.report.results import StudyResults
from analysis.report.style import Figure


class ReportSection(Enum):
    """Sections of the report in the order of the page; the values are the headings."""

    SUMMARY = "Summary"
    CHANGED = "Sensitivity to analysis choices"
    PAPER = "The paper's table and figures"
    BEYOND = "Beyond the paper"
    HEALTH = "Rig health"
    MEASUREMENT_LIMITS = "Measurement limits"
    IMPORTED = "Imported"
    ORIGIN = "Analysis settings and provenance"

    @property
    def anchor(self) -> str:
        """Link target of the section."""
        return self.name.lower()


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table of the report.

    Attributes:
        name: heading of the table.
        header: names of the columns, with units.
        rows: cells as text, each row as long as the header.
        note: remark below the table; empty for none.
        section: section that it belongs to.
    """

    name: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    section: ReportSection = ReportSection.ORIGIN


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """Definition of a figure of the report.

    Attributes:
        key: name of its files, e.g. "fig4_excerpts".
        title: its name, after the paper's figure where there is one.
        alt: alternative text of the picture.
        draw: function that draws it; None if there are no numbers for it.
        caption: function that states its numbers.
        is_vector: shown as interactive SVG on the page.
    """

    key: str
    title: str
    alt: str
    draw: Callable[[StudyResults], Figure | None]
    caption: Callable[[StudyResults], str]
    is_vector: bool = False
