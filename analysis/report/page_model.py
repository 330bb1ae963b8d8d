"""What stands on the page of a report: tables and figures, each in its section."""

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
    """Return a cell as it is shown: with true minus signs, unbroken at ±."""
    return _MINUS.sub("\u2212", text).replace(" ± ", "\u00a0±\u00a0")


def number_columns(table: ReportTable) -> list[bool]:
    """Return of each column whether it holds numbers, which are aligned right."""
    found: list[bool] = []
    for column in zip(*table.rows, strict=True):
        filled = [cell for cell in column if cell not in _NOTHING]
        is_number = all(_NUMBER.fullmatch(cell) for cell in filled)
        found.append(bool(filled) and is_number)
    return found


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


@dataclass(frozen=True, slots=True)
class ShownNumbers:
    """All that the figures of a report follow from.

    Attributes:
        results: of the study.
        with_pdf: figures are wanted as PDF, too.
    """

    results: StudyResults
    with_pdf: bool = False


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


@dataclass(frozen=True, slots=True)
class ReportContext:
    """What a report shows beyond the study itself.

    Attributes:
        title: heading of the page.
        subtitle: line below it.
        is_simulated: the trials were simulated; marks the page.
        is_foreign: the tables come from elsewhere, not from this rig.
        generated_utc: when the report was made, as text.
        tables: further tables, each for its section.
        warnings: further warnings, shown first.
        rig: health of the rig by trial.
        further_numbers: further plain values for fits.json, by name.
        with_pdf: figures are filed as PDF, too.
        results: what follows from the study; None = it is computed.
        store: results of earlier reports; None = everything is computed.
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
