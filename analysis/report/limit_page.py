"""A page of what was measured step by step beside its limits, and beside earlier."""

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.figures.sections import ReportSection
from analysis.figures.style import Figure, new_figure, plain, render, styled
from analysis.report.page import ReportContext, html_page
from analysis.report.page_model import PageSection, ReportFigure, ReportTable

_NOW, _BEFORE, _WRONG = "#0072B2", "#8c8c8c", "#D55E00"
_ROW, _MARGIN = 0.17, 0.7  # inches of a figure
_BEYOND = 1.6  # where a value is drawn that lies further out, in shares of its limit
_NOTHING = "–"


@dataclass(frozen=True, slots=True)
class LimitedValue:
    """A quantity beside its limits.

    Attributes:
        name: what was measured.
        value: of it, in `unit`.
        unit: "" = a number of something.
        low: the least that passes; None = no such limit.
        high: the most that passes; None = no such limit.
        before: as it was measured earlier; None = it was not.
    """

    name: str
    value: float
    unit: str
    low: float | None
    high: float | None
    before: float | None = None

    @property
    def is_within(self) -> bool:
        """Whether it passes."""
        return (self.low is None or self.value >= self.low) and (
            self.high is None or self.value <= self.high
        )

    def share(self, value: float) -> float | None:
        """Return where `value` lies: 0 in the middle, 1 on the limit.

        With one limit only, 1 on the limit and 0 where nothing was measured; None =
        that says nothing, as with a number that must be met exactly.
        """
        low, high = self.low, self.high
        if low is not None and high is not None:
            middle, half = (low + high) / 2.0, (high - low) / 2.0
            return (value - middle) / half if half > 0.0 else None
        if high is not None:
            return value / high if high > 0.0 else None
        return low / value if low is not None and low > 0.0 and value > 0.0 else None


@dataclass(frozen=True, slots=True)
class LimitedStep:
    """A step with everything that was measured in it.

    Attributes:
        name: its number and what it looks at.
        key: its number, of files and links.
        values: what was measured.
        words: who did it, when, with which end.
    """

    name: str
    key: str
    values: Sequence[LimitedValue]
    words: str


@dataclass(frozen=True, slots=True)
class LimitPage:
    """What stands on the page.

    Attributes:
        title: its heading.
        subtitle: line below.
        is_simulated: the arm is; marks the page.
        written_utc: when it was made, as text.
        steps: in their order.
        missing: what was not done or does not count, in words.
        raw: recordings: step, file, SHA-256.
        earlier: what it is drawn beside, in words; "" = nothing.
        offers: settings that were measured otherwise, a sentence each.
    """

    title: str
    subtitle: str
    is_simulated: bool
    written_utc: str
    steps: Sequence[LimitedStep]
    missing: Sequence[str]
    raw: Sequence[tuple[str, str, str]]
    earlier: str = ""
    offers: Sequence[str] = ()


def limit_html(page: LimitPage) -> str:
    """Return the page as HTML."""
    context = ReportContext(
        title=page.title,
        subtitle=page.subtitle,
        is_simulated=page.is_simulated,
        is_foreign=False,
        generated_utc=page.written_utc,
    )
    sentences = [f"Drawn beside {page.earlier}."] if page.earlier else []
    sentences += [f"Offered, not taken: {text}" for text in page.offers]
    figures = [figure for step in page.steps if (figure := _figure(page, step))]
    sections = [
        PageSection(
            ReportSection.COMMISSIONING,
            sentences,
            [_table(step, has_before=bool(page.earlier)) for step in page.steps],
            figures,
        ),
        PageSection(
            ReportSection.ORIGIN,
            (),
            [ReportTable("Recordings", ("step", "file", "SHA-256"), page.raw)],
            (),
        ),
    ]
    return html_page(context, sections, page.missing)


def _table(step: LimitedStep, *, has_before: bool) -> ReportTable:
    rows: list[list[str]] = []
    for each in step.values:
        row = [each.name, f"{each.value:.4g}", _text(each.low), _text(each.high)]
        if has_before:
            row.append(_text(each.before))
        rows.append([*row, each.unit, "" if each.is_within else "beyond"])
    header = ["measured", "value", "at least", "at most"]
    header += ["earlier"] if has_before else []
    return ReportTable(
        step.name,
        (*header, "unit", "verdict"),
        rows,
        step.words,
        ReportSection.COMMISSIONING,
    )


def _text(value: float | None) -> str:
    return _NOTHING if value is None else f"{value:.4g}"


def _figure(page: LimitPage, step: LimitedStep) -> ReportFigure | None:
    """Return the values of a step as shares of their limits; None = there is none."""
    drawn = [each for each in step.values if each.share(each.value) is not None]
    if not drawn:
        return None
    with styled():
        figure = _draw(drawn)
    picture = render(f"limits_{step.key}", figure, page.is_simulated, is_vector=True)
    caption = (
        "Share of the limit: dashed lines are the limits, 0 is the middle between two, "
        "or nothing at all. Blue: as measured, orange: beyond. What lies further out "
        "is drawn at the edge."
    )
    return ReportFigure(
        ReportSection.COMMISSIONING,
        step.name,
        f"A row for each of {len(drawn)} quantities of {step.name}, a mark where it "
        "lies between its limits.",
        caption + (" Grey: as it was earlier." if page.earlier else ""),
        picture,
        is_filed=False,
    )


def _draw(values: Sequence[LimitedValue]) -> Figure:
    figure = new_figure(_MARGIN + _ROW * len(values))
    ax = figure.subplots()
    for row, each in enumerate(values):
        if each.before is not None:
            ax.plot(_places(each, each.before), [row], "o", color=_BEFORE, ms=5)
        colour, mark = (_NOW, "o") if each.is_within else (_WRONG, "D")
        ax.plot(_places(each, each.value), [row], mark, color=colour, ms=4)
    for limit in (-1.0, 1.0):
        ax.axvline(limit, ls="--", color="black", lw=0.8)
    ax.set_xlim(-_BEYOND, _BEYOND)
    ax.set_ylim(len(values) - 0.5, -0.5)
    ax.set_yticks(range(len(values)), [plain(each.name) for each in values])
    ax.set_xlabel("share of the limit")
    return figure


def _places(each: LimitedValue, value: float) -> list[float]:
    """Return where a value is drawn; [] = nowhere."""
    share = each.share(value)
    return [] if share is None else [min(max(share, -_BEYOND), _BEYOND)]
