"""The figures of a report, drawn once for the same numbers and the same code.

Drawing takes longer than all else of a report whose fits are kept, so its figures may
be kept, too. They are known by all that they show and by the code that draws them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.cores import available_cores
from analysis.report.page_model import ReportFigure, ShownNumbers
from analysis.report.sections.order import FIGURES, SECTION_OF
from analysis.study.store import ResultStore
from analysis.study.study import Study
from analysis.study.tasks import run_tasks

_MOST_DRAWING = 4  # processes
_SLOWEST_FIRST = tuple(FIGURES)[::-1]
_MANY_TERRAINS = 2  # from which on they pay: the workers are there, of the fits


def report_figures(shown: ShownNumbers) -> list[ReportFigure]:
    """Return every figure that there are numbers for, in the order of the page.

    Processes that draw share no figure, so pictures are the same by any number of them.
    """
    count = _processes(shown.results.study)
    shares = [FigureTask(shown, _SLOWEST_FIRST[k::count]) for k in range(count)]
    drawn = {
        figure.picture.key: figure
        for figures in run_tasks(draw_figures, shares, count)
        for figure in figures
    }
    return [drawn[key] for key in FIGURES if key in drawn]


@dataclass(frozen=True, slots=True)
class FigureTask:
    """Figures to draw.

    Attributes:
        shown: what they show.
        keys: which.
    """

    shown: ShownNumbers
    keys: Sequence[str]


def draw_figures(task: FigureTask) -> list[ReportFigure]:
    """Return those of the figures that there are numbers for."""
    drawn = (_draw(key, task.shown) for key in task.keys)
    return [figure for figure in drawn if figure is not None]


def _draw(key: str, shown: ShownNumbers) -> ReportFigure | None:
    from analysis.report.style import render, styled

    results, with_pdf = shown.results, shown.with_pdf
    is_simulated = results.study.simulated
    spec = FIGURES[key]
    with styled():
        figure = spec.draw(results)
        if figure is None:
            return None
        vector = {"is_vector": spec.is_vector, "with_pdf": with_pdf}
        picture = render(key, figure, is_simulated, **vector)
    return ReportFigure(
        SECTION_OF[key].heading, spec.title, spec.alt, spec.caption(results), picture
    )


def kept_figures(shown: ShownNumbers, store: ResultStore | None) -> list[ReportFigure]:
    """Return every figure that there are numbers for, from the store or drawn anew.

    Args:
        shown: what they show.
        store: figures of earlier reports; None = they are drawn every time.
    """
    if store is None:
        return report_figures(shown)
    kept = store.get(report_figures, shown)
    if isinstance(kept, tuple) and all(isinstance(k, ReportFigure) for k in kept):
        return list(kept)
    drawn = report_figures(shown)
    store.put(report_figures, shown, drawn)
    return drawn


def _processes(study: Study) -> int:
    """Return how many processes draw; few panels cost less than starting one."""
    if len(study.terrains) < _MANY_TERRAINS:
        return 1
    return min(study.options.n_jobs or available_cores(), _MOST_DRAWING)
