"""The parts of a report: its sections, and the tables and figures they hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from analysis.figures.style import Picture


class ReportSection(Enum):
    """A part of the report; the value is its heading, the order that of the page."""

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
class ReportFigure:
    """A figure of the report.

    Attributes:
        section: where it stands.
        title: its name, after the paper's figure where there is one.
        alt: what the picture shows, for those who cannot see it.
        caption: what is seen in it.
        picture: its files.
    """

    section: ReportSection
    title: str
    alt: str
    caption: str
    picture: Picture
