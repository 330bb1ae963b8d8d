"""The figures of a report, collected from their modules and drawn side by side."""

from dataclasses import dataclass

from analysis.figures import (
    FigureSpec,
    confusion,
    curves,
    errors,
    render,
    rig,
    styled,
    surfaces,
    trials,
    uncertainty,
)
from analysis.findings import StudyResults
from analysis.report.page_model import ReportFigure
from analysis.study import run_tasks

_FAMILIES = (curves, surfaces, errors, uncertainty, confusion, trials, rig)
_PAGE_ORDER = (
    "fig4_excerpts",
    "fig5_tustin",
    "fig6_gp",
    "fig7_gp_mean",
    "fig8_gp_variance",
    "fig9_errors",
    "fig10_cross_bars",
    "fig10_cross_map",
    "calibration",
    "noise",
    "confusion_terrains",
    "confusion_stones",
    "confusion_surface",
    "coverage",
    "trials",
    "trends",
    "residuals",
    "stick_slip",
    "timing",
    "rig",
)
FIGURES: tuple[FigureSpec, ...] = tuple(
    sorted(
        (spec for family in _FAMILIES for spec in family.FIGURES),
        key=lambda spec: _PAGE_ORDER.index(spec.key),
    )
)


def report_figures(results: StudyResults, n_jobs: int = 1) -> list[ReportFigure]:
    """Return every figure that there are numbers for, in the order of the page.

    Args:
        results: what is shown.
        n_jobs: processes that draw; they share no figure, so pictures are the same.
    """
    batches = [FigureBatch(results, k, n_jobs) for k in range(n_jobs)]
    drawn: dict[str, ReportFigure] = {}
    for batch in run_tasks(draw_batch, batches, n_jobs):
        drawn |= {figure.picture.key: figure for figure in batch}
    return [drawn[spec.key] for spec in FIGURES if spec.key in drawn]


@dataclass(frozen=True, slots=True)
class FigureBatch:
    """The figures that one process draws.

    Attributes:
        results: what is shown.
        first: number of its first figure.
        step: from one of its figures to the next.
    """

    results: StudyResults
    first: int
    step: int


def draw_batch(batch: FigureBatch) -> list[ReportFigure]:
    """Return the figures of a batch that there are numbers for."""
    with styled():
        figures = [
            _draw(spec, batch.results) for spec in FIGURES[batch.first :: batch.step]
        ]
    return [figure for figure in figures if figure is not None]


def _draw(spec: FigureSpec, results: StudyResults) -> ReportFigure | None:
    figure = spec.draw(results)
    if figure is None:
        return None
    picture = render(spec.key, figure, results.study.simulated)
    return ReportFigure(
        spec.section, spec.title, spec.alt, spec.caption(results), picture
    )
