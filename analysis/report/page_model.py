"""Data model of the page of a report: sections, tables and figures."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from analysis.report.pictures import Picture
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.sections.rig_health.health import RigTrial
from analysis.study.store import ResultStore

_MINUS = re.compile(r"(?<![\w.\u2212-])-(?=\.?\d)")
_NUMBER = re.compile(r"[<>≤≥~]? ?[-+\u2212]?\.?\d[\d.,]*( ?(%|±.*|\(.*\)|×.*))?")
_NOTHING = {"", "–", "-"}


def cell_text(text: str) -> str:
    """Typeset a cell: true minus signs, no line break at ±."""
    return _MINUS.sub("\u2212", text).replace(" ± ", "\u00a0±\u00a0")


def number_columns(table: ReportTable) -> list[bool]:
    """Return which columns hold only numbers and are therefore aligned right."""
    is_numeric: list[bool] = []
    for column in zip(*table.rows, strict=True):
        filled = [cell for cell in column if cell not in _NOTHING]
        is_number = all(_NUMBER.fullmatch(cell) for cell in filled)
        is_numeric.append(bool(filled) and is_number)
    return is_numeric


@dataclass(frozen=True, slots=True)
class ReportFigure:
    """A figure of the report.

    Attributes:
        section: section that it belongs to.
        title: its name, after the paper's figure where there is one.
        alt: alternative text of the picture.
        caption: caption with numbers.
        picture: its files.
    """

    section: ReportSection
    title: str
    alt: str
    caption: str
    picture: Picture


@dataclass(frozen=True, slots=True)
class ShownNumbers:
    """Input of the figures of a report.

    Attributes:
        results: results of the study.
        with_pdf: also make PDF files.
    """

    results: StudyResults
    with_pdf: bool = False


@dataclass(frozen=True, slots=True)
class PageSection:
    """One section of the page with its content.

    Attributes:
        heading: heading of the section.
        sentences: list of statements at the top.
        tables: tables, before the figures.
        figures: figures.
    """

    heading: ReportSection
    sentences: Sequence[str]
    tables: Sequence[ReportTable]
    figures: Sequence[ReportFigure]


@dataclass(frozen=True, slots=True)
class ReportContext:
    """Content of a report beyond the study itself.

    Attributes:
        title: heading of the page.
        subtitle: line below it.
        is_simulated: the trials were simulated; marks the page.
        is_foreign: the data come from elsewhere, not from this rig.
        generated_utc: when the report was made, as text.
        tables: further tables, each for its section.
        warnings: further warnings, shown first.
        rig: health of the rig by trial.
        further_numbers: further plain values for fits.json, by name.
        with_pdf: also write figures as PDF.
        results: results of the study; None = compute them.
        store: cache of earlier reports; None = compute everything.
    """

    title: str
    subtitle: str
    is_simulated: bool
    is_foreign: bool
    generated_utc: str
    tables: Sequence[ReportTable] = field(default=())
    warnings: Sequence[str] = field(default=())
    rig: Sequence[RigTrial] = field(default=())
    further_numbers: Mapping[str, Any] = field(default_factory=dict)
    with_pdf: bool = False
    results: StudyResults | None = None
    store: ResultStore | None = None

    @property
    def kind(self) -> str:
        """SIMULATED, FOREIGN or LIVE."""
        if self.is_simulated:
            return "SIMULATED"
        return "FOREIGN" if self.is_foreign else "LIVE"


def _nothing(*_: object) -> Sequence[Any]:
    return ()


@dataclass(frozen=True, slots=True)
class Section:
    """Definition of a section of the report.

    Attributes:
        heading: heading of the section.
        tables: function of results and context that returns its tables.
        figures: its figures in order.
        sentences: function that returns the statements at the top.
    """

    heading: ReportSection
    tables: Callable[[StudyResults, ReportContext], Sequence[ReportTable]] = _nothing
    figures: Sequence[FigureSpec] = ()
    sentences: Callable[[StudyResults], Sequence[str]] = _nothing
