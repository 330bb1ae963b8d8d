"""The figures of a report, drawn once for the same numbers and the same code.

Drawing takes longer than all else of a report whose fits are kept, so its figures may
be kept, too. They are known by all that they show and by the code that draws them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

from acquisition.worker_processes import available_cores
from analysis.report.page_model import ReportFigure, ShownNumbers
from analysis.report.sections.order import FIGURES, SECTION_OF
from analysis.study.jobs import Store, run_tasks
from analysis.study.study import Study

_MOST_DRAWING = 4  # processes
_SLOWEST_FIRST = tuple(FIGURES)[::-1]
_MANY_TERRAINS = 2  # from which on they pay: the workers are there, of the fits


def report_figures(shown: ShownNumbers) -> list[ReportFigure]:
    """Return every figure that there are numbers for, in the order of the page.

    Processes that draw share no figure, so pictures are the same by any number of them.
    """
    n_jobs = _processes(shown.results.study)
    drawn = {
        figure.picture.key: figure
        for figure in run_tasks(draw_figure, FigureTasks(shown), n_jobs)
        if figure is not None
    }
    return [drawn[key] for key in FIGURES if key in drawn]


@dataclass(frozen=True, slots=True)
class FigureTask:
    """A figure to draw.

    Attributes:
        shown: what it shows.
        key: which.
    """

    shown: ShownNumbers
    key: str


class FigureTasks(Sequence[FigureTask]):
    """Every figure, those first that take longest."""

    def __init__(self, shown: ShownNumbers) -> None:
        self._shown = shown

    def __len__(self) -> int:
        """Return the number of figures."""
        return len(FIGURES)

    @overload
    def __getitem__(self, index: int) -> FigureTask: ...
    @overload
    def __getitem__(self, index: slice) -> list[FigureTask]: ...
    def __getitem__(self, index: int | slice) -> FigureTask | list[FigureTask]:
        """Return a figure with what it shows."""
        keys = _SLOWEST_FIRST[index]
        if isinstance(keys, str):
            return FigureTask(self._shown, keys)
        return [FigureTask(self._shown, key) for key in keys]

    def outline(self, index: int) -> object:
        """Return the key of the figure."""
        return _SLOWEST_FIRST[index]


def draw_figure(task: FigureTask) -> ReportFigure | None:
    """Return a figure; None where there are no numbers for it."""
    return _draw(task.key, task.shown)


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


def kept_figures(shown: ShownNumbers, store: Store | None) -> list[ReportFigure]:
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
