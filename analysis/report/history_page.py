"""A page of what was measured again and again: each quantity over time, with limits."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from analysis.figures.sections import ReportSection
from analysis.figures.style import Figure, new_figure, plain, render, styled
from analysis.report.page import ReportContext, html_page
from analysis.report.page_model import PageSection, ReportFigure, ReportTable

_SOUND, _WRONG = "#0072B2", "#D55E00"
_HEIGHT = 1.5  # inches of a figure
_ROWS = 60  # of the table, the newest
_NOTHING = "–"


@dataclass(frozen=True, slots=True)
class HistorySeries:
    """A quantity over time.

    Attributes:
        key: of files and links.
        name: what was measured.
        unit: of all values; "" = a number of something.
        low: the least that passes; None = no such limit.
        high: the most that passes; None = no such limit.
        values: when and what, the oldest first.
    """

    key: str
    name: str
    unit: str
    low: float | None
    high: float | None
    values: Sequence[tuple[datetime, float]]

    def is_within(self, value: float) -> bool:
        """Return whether a value passes."""
        return (self.low is None or value >= self.low) and (
            self.high is None or value <= self.high
        )


@dataclass(frozen=True, slots=True)
class HistoryPage:
    """What stands on the page.

    Attributes:
        title: its heading.
        subtitle: line below.
        is_simulated: the arm is; marks the page.
        written_utc: when it was made, as text.
        series: what is drawn, a figure each.
        rows: every time it was measured, the newest last: when, by whom, what came of
            it.
    """

    title: str
    subtitle: str
    is_simulated: bool
    written_utc: str
    series: Sequence[HistorySeries]
    rows: Sequence[tuple[str, str, str]]


def history_html(page: HistoryPage) -> str:
    """Return the page as HTML."""
    context = ReportContext(
        title=page.title,
        subtitle=page.subtitle,
        is_simulated=page.is_simulated,
        is_foreign=False,
        generated_utc=page.written_utc,
    )
    newest = [*page.rows][: -_ROWS - 1 : -1]
    table = ReportTable(
        "Every day, the newest first",
        ("when", "by", "what came of it"),
        newest,
        f"{len(page.rows)} checks, the newest {len(newest)} of them here.",
        ReportSection.COMMISSIONING,
    )
    values = ReportTable(
        "Last values",
        ("measured", "value", "at least", "at most", "unit", "drift"),
        [_row(each) for each in page.series],
        "Drift: the last value less the first one.",
        ReportSection.COMMISSIONING,
    )
    figures = [_figure(page, each) for each in page.series]
    section = PageSection(ReportSection.COMMISSIONING, (), [values, table], figures)
    return html_page(context, [section], ())


def _row(series: HistorySeries) -> list[str]:
    last = series.values[-1][1]
    limits = [
        _NOTHING if each is None else f"{each:.4g}"
        for each in (series.low, series.high)
    ]
    drift = f"{last - series.values[0][1]:+.3g}"
    return [series.name, f"{last:.4g}", *limits, series.unit, drift]


def _figure(page: HistoryPage, series: HistorySeries) -> ReportFigure:
    with styled():
        figure = _draw(series)
    picture = render(f"history_{series.key}", figure, page.is_simulated, is_vector=True)
    return ReportFigure(
        ReportSection.COMMISSIONING,
        series.name,
        f"{len(series.values)} values of {series.name} over time, the last one "
        f"{series.values[-1][1]:.4g} {series.unit}".rstrip()
        + ".",
        "Dashed lines are the limits. Blue: passed, orange: did not.",
        picture,
        is_filed=False,
    )


def _draw(series: HistorySeries) -> Figure:
    figure = new_figure(_HEIGHT)
    ax = figure.subplots()
    first = series.values[0][0]
    days = [(when - first).total_seconds() / 86400.0 for when, _ in series.values]
    for day, (_, value) in zip(days, series.values, strict=True):
        is_within = series.is_within(value)
        colour, mark = (_SOUND, "o") if is_within else (_WRONG, "D")
        ax.plot([day], [value], mark, color=colour, ms=4)
    ax.plot(days, [value for _, value in series.values], color=_SOUND, lw=0.8)
    for limit in (series.low, series.high):
        if limit is not None:
            ax.axhline(limit, ls="--", color="black", lw=0.8)
    ax.set_xlabel(f"days since {first:%Y-%m-%d %H:%M} UTC")
    ax.set_ylabel(plain(f"[{series.unit}]") if series.unit else "")
    return figure
