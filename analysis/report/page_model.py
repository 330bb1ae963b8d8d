"""What stands on the page of a report: tables and figures, each in its section."""

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.figures import Picture, ReportSection


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
        is_filed: the files lie in a folder of figures, not in the page alone.
    """

    section: ReportSection
    title: str
    alt: str
    caption: str
    picture: Picture
    is_filed: bool = True


@dataclass(frozen=True, slots=True)
class PageSection:
    """One section of the page with everything in it.

    Attributes:
        heading: which one.
        sentences: what stands first.
        tables: its tables, before the figures.
        figures: its figures.
    """

    heading: ReportSection
    sentences: Sequence[str]
    tables: Sequence[ReportTable]
    figures: Sequence[ReportFigure]
