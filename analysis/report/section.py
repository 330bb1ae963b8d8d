"""What a section of the report is: one value with its heading, tables and figures.

A table or a figure is drawn from `StudyResults`; what else a page holds, as tables of
sessions, joins the section that it names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from analysis.report.style import Figure

if TYPE_CHECKING:
    from analysis.report.page_model import ReportContext
    from analysis.report.results import StudyResults


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


def _nothing(*_: object) -> Sequence[Any]:
    return ()


@dataclass(frozen=True, slots=True)
class Section:
    """A section of the report.

    Attributes:
        heading: which one.
        tables: its tables, of the results and of what else the page shows.
        figures: its figures, in their order.
        sentences: what stands first.
    """

    heading: ReportSection
    tables: Callable[[StudyResults, ReportContext], Sequence[ReportTable]] = _nothing
    figures: Sequence[FigureSpec] = ()
    sentences: Callable[[StudyResults], Sequence[str]] = _nothing
