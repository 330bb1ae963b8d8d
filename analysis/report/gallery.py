"""The figures of a report in the order of its page; whoever loads this draws."""

from analysis.figures import (
    PAGE_ORDER,
    FigureSpec,
    break_away,
    confusion,
    curves,
    errors,
    excerpts,
    render,
    rig,
    styled,
    surfaces,
    trials,
    uncertainty,
)
from analysis.report.foresight_page import foresight_figure
from analysis.report.page_model import ReportFigure, ShownNumbers

_FAMILIES = (
    *(excerpts, curves, surfaces, errors, uncertainty),
    *(break_away, confusion, trials, rig),
)
FIGURES: tuple[FigureSpec, ...] = tuple(
    sorted(
        (spec for family in _FAMILIES for spec in family.FIGURES),
        key=lambda spec: PAGE_ORDER.index(spec.key),
    )
)


def draw_figure(key: str, shown: ShownNumbers) -> ReportFigure | None:
    """Return a figure of the page; None where there are no numbers for it.

    Args:
        key: one of `PAGE_ORDER`.
        shown: what figures show.
    """
    results = shown.results
    spec = next((spec for spec in FIGURES if spec.key == key), None)
    if spec is None:
        return _foresight(shown)
    with styled():
        figure = spec.draw(results)
        if figure is None:
            return None
        picture = render(
            spec.key,
            figure,
            results.study.simulated,
            is_vector=spec.is_vector,
            with_pdf=shown.with_pdf,
        )
    return ReportFigure(
        spec.section, spec.title, spec.alt, spec.caption(results), picture
    )


def _foresight(shown: ShownNumbers) -> ReportFigure | None:
    if shown.foresight is None:
        return None
    is_simulated = shown.results.study.simulated
    return foresight_figure(
        shown.foresight, is_simulated=is_simulated, with_pdf=shown.with_pdf
    )
