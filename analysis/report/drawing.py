"""Drawing and caching of the figures of a report.

Drawing takes longer than everything else in a report with cached fits, so figures can
be cached, too. They are keyed by the numbers they show and the code that draws them.
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

_MOST_DRAWING = 4  # drawing processes
_MANY_TERRAINS = 2  # terrains from which several processes pay off


@dataclass(frozen=True, slots=True)
class FigureTask:
    """Figures to draw.

    Attributes:
        shown: numbers that they show.
        keys: keys of the figures.
    """

    shown: ShownNumbers
    keys: Sequence[str]


def report_figures(task: FigureTask) -> list[ReportFigure]:
    """Draw those of the figures that have numbers, in the order of the keys.

    Every figure is drawn by one process, so the number of processes does not matter.
    """
    count = _processes(task.shown.results.study)
    slowest_first = task.keys[::-1]
    shares = [FigureTask(task.shown, slowest_first[k::count]) for k in range(count)]
    drawn = {
        figure.picture.key: figure
        for figures in run_tasks(draw_figures, shares, count)
        for figure in figures
    }
    return [drawn[key] for key in task.keys if key in drawn]


def draw_figures(task: FigureTask) -> list[ReportFigure]:
    """Draw those of the figures that have numbers."""
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


def cached_figures(task: FigureTask, store: ResultStore | None) -> list[ReportFigure]:
    """Return those of the figures that have numbers, from the cache or newly drawn.

    Args:
        task: figures, and the numbers that they show.
        store: cache of figures; None = always draw.
    """
    if store is None:
        return report_figures(task)
    cached = store.get(report_figures, task)
    if isinstance(cached, tuple) and all(isinstance(f, ReportFigure) for f in cached):
        return list(cached)
    drawn = report_figures(task)
    store.put(report_figures, task, drawn)
    return drawn


def _processes(study: Study) -> int:
    """Return the number of drawing processes; one for few panels."""
    if len(study.terrains) < _MANY_TERRAINS:
        return 1
    return min(study.options.n_jobs or available_cores(), _MOST_DRAWING)
