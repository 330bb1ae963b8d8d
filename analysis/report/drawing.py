"""The figures of a report, drawn once for the same numbers and the same code.

Drawing takes longer than all else of a report whose fits are kept, so its figures may
be kept, too. They are known by a digest of all that they show and of the code that
draws them: whatever is changed in the analysis, they are drawn anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from acquisition.worker_processes import available_cores
from analysis.figures.pictures import Picture
from analysis.figures.sections import PAGE_ORDER, ReportSection
from analysis.report.foresight_page import FORESIGHT_KEY, foresight_figure
from analysis.report.page_model import ReportFigure, ShownNumbers
from analysis.study.jobs import Store, run_tasks
from analysis.study.study import Study

if TYPE_CHECKING:
    from analysis.figures.spec import FigureSpec

_KEYS = (*PAGE_ORDER, FORESIGHT_KEY)
_MOST_DRAWING = 4  # processes
_MANY_TERRAINS = 2  # from which on they pay: the workers are there, of the fits
_PLAIN = (type(None), bool, int, float, str, bytes, Enum)
_DRAWN_BY = ("matplotlib", "numpy", "pillow")  # besides the analysis
DRAWN_TYPES: Mapping[str, type] = {
    kind.__name__: kind for kind in (Picture, ReportFigure, ReportSection)
}


def report_figures(shown: ShownNumbers, n_jobs: int = 1) -> list[ReportFigure]:
    """Return every figure that there are numbers for, in the order of the page.

    Args:
        shown: what they show.
        n_jobs: processes that draw; they share no figure, so pictures are the same.
    """
    drawn = {
        figure.picture.key: figure
        for figure in run_tasks(draw_figure, FigureTasks(shown), n_jobs)
        if figure is not None
    }
    return [drawn[key] for key in _KEYS if key in drawn]


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
        return len(_KEYS)

    @overload
    def __getitem__(self, index: int) -> FigureTask: ...
    @overload
    def __getitem__(self, index: slice) -> list[FigureTask]: ...
    def __getitem__(self, index: int | slice) -> FigureTask | list[FigureTask]:
        """Return a figure with what it shows."""
        keys = _KEYS[::-1][index]
        if isinstance(keys, str):
            return FigureTask(self._shown, keys)
        return [FigureTask(self._shown, key) for key in keys]

    def outline(self, index: int) -> object:
        """Return the key of the figure."""
        return _KEYS[::-1][index]


def draw_figure(task: FigureTask) -> ReportFigure | None:
    """Return a figure; None where there are no numbers for it."""
    return _draw(task.key, task.shown)


def _draw(key: str, shown: ShownNumbers) -> ReportFigure | None:
    from analysis.figures.style import render, styled

    results, with_pdf = shown.results, shown.with_pdf
    is_simulated = results.study.simulated
    if key == FORESIGHT_KEY:
        curves = shown.foresight
        if curves is None:
            return None
        return foresight_figure(curves, is_simulated=is_simulated, with_pdf=with_pdf)
    spec = figure_specs()[key]
    with styled():
        figure = spec.draw(results)
        if figure is None:
            return None
        vector = {"is_vector": spec.is_vector, "with_pdf": with_pdf}
        picture = render(key, figure, is_simulated, **vector)
    return ReportFigure(
        spec.section, spec.title, spec.alt, spec.caption(results), picture
    )


@cache
def figure_specs() -> Mapping[str, FigureSpec]:
    """Return the figures of a study by their keys; whoever asks loads matplotlib."""
    from analysis.figures import (
        break_away,
        confusion,
        curves,
        errors,
        excerpts,
        rig,
        surfaces,
        trials,
        uncertainty,
    )

    families = (
        *(excerpts, curves, surfaces, errors, uncertainty),
        *(break_away, confusion, trials, rig),
    )
    return {spec.key: spec for family in families for spec in family.FIGURES}


@dataclass(frozen=True, slots=True)
class DrawingTask:
    """What figures follow from.

    Attributes:
        shown: digest of the numbers.
        code: digest of the code that draws.
        is_simulated: the numbers were.
        with_pdf: figures are wanted as PDF, too.
    """

    shown: str
    code: str
    is_simulated: bool
    with_pdf: bool


def kept_figures(shown: ShownNumbers, store: Store | None = None) -> list[ReportFigure]:
    """Return every figure that there are numbers for, in the order of the page.

    Args:
        shown: what they show.
        store: figures of earlier reports.
    """
    study = shown.results.study

    def draw() -> list[ReportFigure]:
        return report_figures(shown, _processes(study))

    return drawn_once(
        shown, draw, store, is_simulated=study.simulated, with_pdf=shown.with_pdf
    )


def drawn_once(
    shown: Any,  # noqa: ANN401
    draw: Callable[[], Sequence[ReportFigure]],
    store: Store | None,
    *,
    is_simulated: bool,
    with_pdf: bool,
) -> list[ReportFigure]:
    """Return figures from the store, or draw and keep them.

    Args:
        shown: all that they show: dataclasses, arrays, mappings, plain values.
        draw: draws them.
        store: figures of earlier reports.
        is_simulated: the numbers were.
        with_pdf: figures are wanted as PDF, too.
    """
    if store is None:
        return list(draw())
    task = DrawingTask(shown_digest(shown), code_digest(), is_simulated, with_pdf)
    kept = store.get(task)
    if isinstance(kept, tuple) and all(isinstance(k, ReportFigure) for k in kept):
        return list(kept)
    drawn = list(draw())
    store.put(task, drawn)
    return drawn


def shown_digest(shown: Any) -> str:  # noqa: ANN401
    """Return the SHA-256 of a value.

    Raises:
        TypeError: a value of a kind whose content is not known.
    """
    digest = hashlib.sha256()
    for part in _parts(shown):
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:  # noqa: ANN401
    """Give the bytes of a value, each with its kind and the count of what is inside."""
    if isinstance(value, np.generic):  # the store gives it back as a plain value
        value = value.item()
    kind = type(value).__name__
    if isinstance(value, np.ndarray):
        yield f"{kind} {value.dtype.str} {value.shape}".encode()
        yield value.tobytes()
    elif isinstance(value, _PLAIN):
        yield f"{kind} {value!r}".encode()
    elif isinstance(value, Mapping) or is_dataclass(value):
        inside = value if isinstance(value, Mapping) else _fields_of(value)
        yield f"{kind} {len(inside)}".encode()
        for key, item in inside.items():
            yield from _parts(key)
            yield from _parts(item)
    elif isinstance(value, list | tuple):
        yield f"{kind} {len(value)}".encode()
        for item in value:
            yield from _parts(item)
    else:
        raise TypeError(f"{kind} has no digest")


def _fields_of(value: Any) -> dict[str, Any]:  # noqa: ANN401
    return {item.name: getattr(value, item.name) for item in fields(value)}


@lru_cache
def code_digest() -> str:
    """Return the SHA-256 of the analysis and of the libraries' versions."""
    folder = Path(__file__).parents[1]
    digest = hashlib.sha256(" ".join(map(version, _DRAWN_BY)).encode())
    for path in sorted(folder.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(folder)} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


def _processes(study: Study) -> int:
    """Return how many processes draw; few panels cost less than starting one."""
    if len(study.terrains) < _MANY_TERRAINS:
        return 1
    return min(study.options.n_jobs or available_cores(), _MOST_DRAWING)
